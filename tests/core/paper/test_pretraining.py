"""Tests stage 1, pretraining, at toy size: it learns, is reproducible, and can be interrupted."""

from dataclasses import replace

import numpy as np
import pytest
import torch

import nicmm_core as nicmm
from nicmm_core import shapes
from nicmm_core.paper import pretraining
from nicmm_core.paper.losses import (
    LossWeights,
    balanced,
    energy_surface,
    loss_terms,
    total_loss,
)
from nicmm_core.paper.network import NetworkConfig, NetworkInput
from nicmm_core.paper.pretraining import PretrainingConfig, pretrain, randomly_reoriented
from nicmm_core.paper.weights_file import load_network

NETWORK = NetworkConfig(width=12, depth=1, gate_rank=2)
SETTINGS = PretrainingConfig(sets=4, batch=2, epochs=3, seed=7)


@pytest.fixture(scope="module")
def meshes():
    return [shapes.creature(seed, faces=200, subdivisions=0) for seed in (1, 2)]


def train(meshes, path, settings=SETTINGS, network=NETWORK, progress=None):
    return pretrain(meshes, path, network, settings, progress=progress)


def weights_in(path):
    return load_network(path).parameters


def assert_same_weights(first, second):
    assert set(first) == set(second)
    for name in first:
        np.testing.assert_array_equal(first[name], second[name], name)


@pytest.fixture(scope="module")
def finished(meshes, tmp_path_factory):
    """An uninterrupted run: path of its weights, and losses of its epochs."""
    path = tmp_path_factory.mktemp("pretraining") / "weights.npz"
    return path, train(meshes, path)


@pytest.mark.slow
def test_loss_falls(meshes, tmp_path):
    losses = train(
        meshes, tmp_path / "weights.npz", PretrainingConfig(sets=4, batch=1, epochs=8, seed=7)
    )
    assert len(losses) == 8
    assert np.isfinite(losses).all()
    assert losses[-1] < 0.97 * losses[0], losses


@pytest.mark.slow
def test_writes_weights_that_load_and_nothing_else(finished):
    path, losses = finished
    assert len(losses) == SETTINGS.epochs
    assert load_network(path).config == NETWORK
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_training_changes_the_network(finished):
    assert np.abs(weights_in(finished[0])["head.weight"]).max() > 0.0


@pytest.mark.slow
def test_same_seed_gives_identical_weights(meshes, finished, tmp_path):
    torch.manual_seed(123)
    np.random.seed(123)
    losses = train(meshes, tmp_path / "again.npz")
    assert losses == finished[1]
    assert_same_weights(weights_in(tmp_path / "again.npz"), weights_in(finished[0]))


@pytest.mark.slow
def test_other_seed_gives_other_weights(meshes, finished, tmp_path):
    train(meshes, tmp_path / "other.npz", PretrainingConfig(sets=4, batch=2, epochs=3, seed=8))
    other, first = weights_in(tmp_path / "other.npz"), weights_in(finished[0])
    assert not np.array_equal(other["stem.weight"], first["stem.weight"])


class StopError(Exception):
    """Exception that a progress function raises to stop a run."""


def interrupt_in_epoch(number, settings=SETTINGS):
    """Progress function that stops a run in the middle of an epoch."""

    def progress(stage, done, total, loss):
        if stage == "training" and done == (number - 1) * settings.sets + 2:
            raise StopError

    return progress


@pytest.mark.slow
@pytest.mark.parametrize("epoch", [1, 3])
def test_interrupted_run_ends_with_the_weights_of_an_uninterrupted_one(
    meshes, finished, tmp_path, epoch
):
    path = tmp_path / "weights.npz"
    with pytest.raises(StopError):
        train(meshes, path, progress=interrupt_in_epoch(epoch))
    assert not path.exists()
    steps = []
    losses = train(
        meshes,
        path,
        progress=lambda stage, done, *_: steps.append(done) if stage == "training" else None,
    )
    # It continues after the last complete epoch.
    assert steps[0] == (epoch - 1) * SETTINGS.sets + 1
    assert losses == finished[1]
    assert_same_weights(weights_in(path), weights_in(finished[0]))


@pytest.mark.slow
def test_checkpoint_of_other_settings_is_refused(meshes, tmp_path):
    path = tmp_path / "weights.npz"
    with pytest.raises(StopError):
        train(meshes, path, progress=interrupt_in_epoch(2))
    for change in (
        {"settings": replace(SETTINGS, epochs=5)},
        {"settings": replace(SETTINGS, seed=8)},
        {"settings": replace(SETTINGS, batch=4)},
        {"network": NetworkConfig(width=12, depth=1, gate_rank=2, attention=False)},
    ):
        with pytest.raises(nicmm.ArgumentError, match="settings"):
            train(meshes, path, **change)


@pytest.mark.slow
def test_checkpoint_of_other_meshes_is_refused(meshes, tmp_path):
    """Continuing on other meshes would give weights that no single command can reproduce."""
    path = tmp_path / "weights.npz"
    with pytest.raises(StopError):
        train(meshes, path, progress=interrupt_in_epoch(2))
    with pytest.raises(nicmm.ArgumentError):
        train(meshes[:1], path)


@pytest.mark.slow
def test_unreadable_checkpoint_is_refused_by_name(meshes, tmp_path):
    """A checkpoint is truncated if a run is killed while it writes."""
    path = tmp_path / "weights.npz"
    with pytest.raises(StopError):
        train(meshes, path, progress=interrupt_in_epoch(2))
    (checkpoint,) = tmp_path.iterdir()
    checkpoint.write_bytes(checkpoint.read_bytes()[:200])
    with pytest.raises(nicmm.ArgumentError, match=checkpoint.name):
        train(meshes, path)


@pytest.mark.slow
def test_progress_counts_up_to_all_steps(meshes, tmp_path):
    calls = []
    train(meshes, tmp_path / "weights.npz", progress=lambda *call: calls.append(call))
    for stage, total in (("preparing", 4), ("training", 12)):
        done = [call[1:3] for call in calls if call[0] == stage]
        assert done == [(i, total) for i in range(1, total + 1)]
    assert all(np.isfinite(call[3]) for call in calls)


def test_no_meshes_are_refused(tmp_path):
    with pytest.raises(nicmm.ArgumentError, match="^meshes"):
        train([], tmp_path / "weights.npz")


def test_mesh_with_too_few_vertices_is_refused(tmp_path):
    triangle = nicmm.Mesh(np.eye(3), [[0, 1, 2]])
    with pytest.raises(nicmm.ArgumentError, match=r"^meshes\[0\]"):
        train([triangle], tmp_path / "weights.npz")


def test_folder_that_does_not_exist_is_refused_before_the_training(meshes, tmp_path):
    steps = []
    with pytest.raises(nicmm.NicmmError):
        train(meshes, tmp_path / "nowhere" / "weights.npz", progress=lambda *c: steps.append(c))
    assert not [stage for stage, *_ in steps if stage == "training"]


@pytest.fixture
def prepared(monkeypatch):
    """List of the sets of a training: whether closed, order, and problem."""
    asked = []
    build = pretraining.build_problem

    def recorded(mesh, points, order, *maps, closed):
        problem = build(mesh, points, order, *maps, closed=closed)
        asked.append((closed, order, problem))
        return problem

    monkeypatch.setattr(pretraining, "build_problem", recorded)
    return asked


@pytest.mark.slow
@pytest.mark.parametrize(
    ("open_share", "given_share", "expected"),
    [
        (1.0, 0.0, {(False, "shortest")}),
        (0.0, 1.0, {(True, "given")}),
        (0.0, 0.0, {(True, "shortest")}),
    ],
)
def test_sets_are_of_the_kinds_asked_for(
    meshes, tmp_path, prepared, open_share, given_share, expected
):
    settings = replace(SETTINGS, epochs=1, open_share=open_share, given_share=given_share)
    train(meshes, tmp_path / "weights.npz", settings)
    assert {(closed, order) for closed, order, _ in prepared} == expected


@pytest.mark.slow
def test_kinds_are_mixed_by_their_shares(meshes, tmp_path, prepared):
    settings = replace(SETTINGS, sets=20, epochs=1, open_share=0.4, given_share=0.3)
    train(meshes, tmp_path / "weights.npz", settings)
    open_curves = sum(not closed for closed, _, _ in prepared)
    given = sum(order == "given" for _, order, _ in prepared)
    assert 3 <= open_curves <= 13
    assert 2 <= given <= 11


@pytest.mark.slow
def test_energy_is_that_of_designs_and_knows_no_axes(meshes, tmp_path, prepared):
    """An untrained network returns φ₀, or -φ₀ if the sign is reversed, with the same energy."""
    settings = replace(SETTINGS, learning_rate=0.0)
    losses = train(meshes, tmp_path / "weights.npz", settings)
    expected = [
        total_loss(
            loss_terms(energy_surface(problem), problem.initial_distance),
            balanced(LossWeights(), problem),
        )
        for _, _, problem in prepared
    ]
    np.testing.assert_allclose(losses, np.mean(expected), rtol=1e-4)


@pytest.mark.slow
def test_loss_weights_are_lowered_set_by_set(prepared, meshes, tmp_path):
    settings = replace(SETTINGS, epochs=1, learning_rate=0.0)
    stiff = LossWeights(smooth=100.0)
    (loss,) = pretrain(meshes, tmp_path / "weights.npz", NETWORK, settings, stiff)
    flat = np.mean(
        [
            total_loss(loss_terms(energy_surface(p), p.initial_distance), stiff)
            for _, _, p in prepared
        ]
    )
    assert loss < 0.01 * flat


@pytest.mark.slow
@pytest.mark.parametrize("channels", [8, 9])
def test_reoriented_sets_are_the_same_but_for_axes_and_sign(channels):
    generator = np.random.default_rng(3)
    features = torch.as_tensor(generator.normal(size=(20, channels)), dtype=torch.float32)
    inputs = NetworkInput(features, features[:, 7].clone(), None, None, None)
    before = features.clone()
    orientations = set()
    for _ in range(1000):
        other = randomly_reoriented(inputs, generator)
        axes = np.zeros((3, 3))
        for new in range(3):
            for old in range(3):
                if torch.equal(other.features[:, new].abs(), before[:, old].abs()):
                    axes[new, old] = torch.sign(other.features[0, new] * before[0, old])
        side = torch.sign(other.initial_distance[0] * before[0, 7]).item()
        np.testing.assert_allclose(axes @ axes.T, np.eye(3))
        matrix = torch.as_tensor(axes.T, dtype=torch.float32)
        torch.testing.assert_close(other.features[:, :3], before[:, :3] @ matrix)
        torch.testing.assert_close(other.features[:, 3:6], before[:, 3:6] @ matrix)
        torch.testing.assert_close(other.features[:, 7], other.initial_distance)
        torch.testing.assert_close(other.initial_distance, side * before[:, 7])
        assert torch.equal(other.features[:, 6], before[:, 6])
        assert torch.equal(other.features[:, 8:], before[:, 8:])
        orientations.add((*axes.ravel().tolist(), side))
    assert len(orientations) == 2 * 48
    assert torch.equal(features, before)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"batch": 0}, "batch"),
        ({"open_share": -0.1}, "open_share"),
        ({"open_share": 0.6, "given_share": 0.6}, "given_share"),
    ],
)
def test_impossible_settings_are_refused_by_name(meshes, tmp_path, change, named):
    with pytest.raises(nicmm.ArgumentError, match=named):
        train(meshes, tmp_path / "weights.npz", replace(SETTINGS, **change))


@pytest.mark.slow
def test_sets_with_maps_train_the_ninth_channel(meshes, tmp_path, prepared):
    """Some of the sets have no map; there φ_fea is neutral."""
    settings = replace(SETTINGS, sets=12, epochs=1, map_share=0.5)
    train(meshes, tmp_path / "weights.npz", settings)
    network = load_network(tmp_path / "weights.npz", channels=9)
    assert np.abs(network.parameters["stem.weight"][:, 8]).max() > 0.0
    maps = [problem.feature_map for _, _, problem in prepared]
    neutral = sum((one == 1.0).all() for one in maps)
    assert 2 <= neutral <= 10
    assert min(one.min() for one in maps) < 0.8
    assert max(one.max() for one in maps) > 1.5


@pytest.mark.parametrize("share", [-0.1, 1.1])
def test_shares_of_maps_beyond_all_are_refused(meshes, tmp_path, share):
    with pytest.raises(nicmm.ArgumentError, match="map_share"):
        train(meshes, tmp_path / "weights.npz", replace(SETTINGS, map_share=share))
