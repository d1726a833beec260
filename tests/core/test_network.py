"""The network: what it guarantees for any weights, its switches, and its file."""

import io
import json
import zipfile
from dataclasses import asdict, replace

import numpy as np
import pytest
import torch

import nicmm_core as nicmm
from nicmm_core.network import (
    CurveNetwork,
    EfficientChannelAttention,
    LightGatedLinearUnit,
    NetworkConfig,
    NetworkInput,
)
from nicmm_core.problem import build_problem
from nicmm_core.tensors import network_input
from nicmm_core.weights_file import load_network, save_network
from tests.core.checks import random_surface_points

SMALL = NetworkConfig(width=8, depth=2, gate_rank=2)


def randomised(network, seed=0):
    """The network with every parameter random, its last layer too."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.copy_(torch.randn(parameter.shape, generator=generator) * 0.5)
    return network


@pytest.fixture(scope="module")
def given(small_ball):
    points = random_surface_points(small_ball, 4, seed=3)
    return network_input(build_problem(small_ball, points, "shortest"), torch.device("cpu"))


def with_ninth(given, seed=5):
    ninth = torch.rand((len(given.features), 1), generator=torch.Generator().manual_seed(seed))
    return given._replace(features=torch.cat([given.features, ninth], dim=1))


def count(network):
    return sum(parameter.numel() for parameter in network.parameters())


def test_untrained_network_returns_the_initial_distance(given):
    assert torch.equal(CurveNetwork(SMALL)(given), given.initial_distance)


def test_output_is_zero_at_the_control_points_for_any_weights(given):
    for seed in range(3):
        phi = randomised(CurveNetwork(SMALL), seed)(given)
        change = (phi - given.initial_distance).abs().max().item()
        assert change > 1e-2
        assert phi[given.control_vertices].abs().max().item() < 1e-6 * change


def test_every_parameter_takes_part(given):
    network = randomised(CurveNetwork(SMALL))
    (network(given) ** 2).sum().backward()
    idle = [
        name
        for name, parameter in network.named_parameters()
        # A constant added everywhere is taken off again at the control points, or nearly.
        if name != "head.bias" and not parameter.grad.abs().max() > 0.0
    ]
    assert not idle


def test_switches_remove_parameters(given):
    full = CurveNetwork(SMALL)
    without_attention = CurveNetwork(NetworkConfig(width=8, depth=2, gate_rank=2, attention=False))
    without_gating = CurveNetwork(NetworkConfig(width=8, depth=2, gate_rank=2, gating=False))
    assert count(full) - count(without_attention) == SMALL.depth * SMALL.attention_kernel
    # A gate: down to its rank, up to the width, and a bias.
    assert count(full) - count(without_gating) == SMALL.depth * (2 * 8 * 2 + 8)
    for network in (without_attention, without_gating):
        assert torch.isfinite(randomised(network)(given)).all()


SWITCHED_CHANNELS = {"normals": [3, 4, 5], "control_indicator": [6], "distance": [7]}


@pytest.mark.parametrize("switch", SWITCHED_CHANNELS)
def test_a_channel_switched_off_is_not_seen(given, switch):
    changed = given.features.clone()
    changed[:, SWITCHED_CHANNELS[switch]] += 0.3
    changed = given._replace(features=changed)
    on = randomised(CurveNetwork(SMALL))
    off = randomised(CurveNetwork(replace(SMALL, **{switch: False})))
    assert not torch.equal(on(changed), on(given))
    assert torch.equal(off(changed), off(given))


def test_without_distance_the_output_knows_nothing_of_it(given):
    torch.manual_seed(0)
    network = CurveNetwork(replace(SMALL, distance=False))
    phi = network(given)
    assert torch.equal(phi, network(given._replace(initial_distance=-given.initial_distance)))
    assert phi[given.control_vertices].abs().max() < 1e-5
    # At φ = 0 the energy has no slope, so training could not begin there.
    assert phi.abs().max() > 1e-3


def test_without_attention_a_vertex_does_not_feel_the_others(given):
    """Attention is the only way from one vertex to another, but for the control points."""
    moved = given.features.clone()
    elsewhere = torch.ones(len(moved), dtype=torch.bool)
    elsewhere[given.control_vertices] = False
    elsewhere[0] = False
    moved[elsewhere] += 0.3
    for attention, feels in ((False, False), (True, True)):
        config = NetworkConfig(width=8, depth=2, gate_rank=2, attention=attention)
        network = randomised(CurveNetwork(config))
        before, after = network(given)[0], network(given._replace(features=moved))[0]
        assert (abs(before - after).item() > 1e-4) is feels


def test_attention_couples_neighbouring_channels_only():
    attention = randomised(EfficientChannelAttention(3))
    hidden = torch.rand((20, 12), generator=torch.Generator().manual_seed(0)) + 0.5
    share = torch.full((20,), 1 / 20)
    changed = hidden.clone()
    changed[:, 5] += 1.0
    before = attention(hidden, share) / hidden
    after = attention(changed, share) / changed
    # One weight a channel, the same at every vertex.
    assert torch.allclose(before, before[:1].expand_as(before), atol=1e-6)
    touched = (before - after).abs().amax(dim=0) > 1e-5
    assert touched.nonzero().flatten().tolist() == [4, 5, 6]


def test_attention_sees_the_mean_over_the_area():
    """A vertex of no area has no say."""
    attention = randomised(EfficientChannelAttention(3))
    hidden = torch.rand((3, 6), generator=torch.Generator().manual_seed(0))
    share = torch.tensor([0.5, 0.5, 0.0])
    changed = hidden.clone()
    changed[2] += 10.0
    assert torch.equal(attention(hidden, share)[:2], attention(changed, share)[:2])


def test_gate_is_light():
    """The gate's matrix has the rank asked for, and the gate lies between 0 and 1."""
    unit = randomised(LightGatedLinearUnit(16, 3))
    gate = (unit.gate_up.weight @ unit.gate_down.weight).detach()
    assert torch.linalg.matrix_rank(gate).item() == 3
    hidden = torch.randn((50, 16), generator=torch.Generator().manual_seed(0))
    share = unit(hidden) / unit.value(hidden)
    assert share.min() >= 0.0 and share.max() <= 1.0
    assert share.max() - share.min() > 0.1


def test_renumbering_the_vertices_renumbers_the_output(given):
    network = randomised(CurveNetwork(SMALL))
    shuffle = torch.randperm(len(given.features), generator=torch.Generator().manual_seed(2))
    where = torch.empty_like(shuffle)
    where[shuffle] = torch.arange(len(shuffle))
    shuffled = NetworkInput(
        features=given.features[shuffle],
        initial_distance=given.initial_distance[shuffle],
        area_share=given.area_share[shuffle],
        response=given.response[shuffle],
        control_vertices=where[given.control_vertices],
    )
    expected = network(given)[shuffle]
    assert torch.allclose(network(shuffled), expected, atol=1e-4 * expected.abs().max().item())


def test_weights_survive_the_file(given, tmp_path):
    config = NetworkConfig(width=8, depth=1, gate_rank=3, attention_kernel=5)
    network = randomised(CurveNetwork(config))
    save_network(tmp_path / "weights.npz", network)
    loaded = load_network(tmp_path / "weights.npz")
    assert loaded.config == config
    assert torch.equal(loaded(given), network(given))


@pytest.mark.parametrize("switch", SWITCHED_CHANNELS)
def test_input_switches_survive_the_file(given, tmp_path, switch):
    network = randomised(CurveNetwork(replace(SMALL, **{switch: False})))
    save_network(tmp_path / "weights.npz", network)
    loaded = load_network(tmp_path / "weights.npz")
    assert not getattr(loaded.config, switch)
    assert torch.equal(loaded(given), network(given))


def test_files_without_input_switches_see_every_channel(given, tmp_path):
    network = randomised(CurveNetwork(SMALL))
    arrays = {name: value.numpy() for name, value in network.state_dict().items()}
    config = {k: v for k, v in asdict(SMALL).items() if k not in SWITCHED_CHANNELS}
    np.savez(tmp_path / "weights.npz", config=np.array(json.dumps(config)), **arrays)
    assert torch.equal(load_network(tmp_path / "weights.npz")(given), network(given))


def test_ninth_channel_starts_without_effect(given, tmp_path):
    network = randomised(CurveNetwork(SMALL))
    save_network(tmp_path / "weights.npz", network)
    loaded = load_network(tmp_path / "weights.npz", channels=9)
    first, second = loaded(with_ninth(given, 5)), loaded(with_ninth(given, 6))
    assert torch.equal(first, second)
    assert torch.allclose(first, network(given), rtol=1e-4, atol=1e-5)
    # Yet it can learn one.
    (first**2).sum().backward()
    assert loaded.stem.weight.grad[:, 8].abs().max() > 0.0


def test_shipped_weights_load_for_both_numbers_of_channels(given):
    for channels, features in ((8, given), (9, with_ninth(given))):
        phi = load_network(channels=channels)(features)
        assert torch.isfinite(phi).all()
        assert phi.shape == given.initial_distance.shape


def archive_without(path, network, name):
    """Weights from which an array is missing."""
    arrays = {key: value.numpy() for key, value in network.state_dict().items()}
    save_network(path, network)
    with np.load(path) as archive:
        arrays = {key: archive[key] for key in archive.files if key != name}
    np.savez(path, **arrays)


def bad_files(folder):
    """Files that are no weights, each with its defect."""
    network = CurveNetwork(SMALL)
    paths = {name: folder / f"{name.replace(' ', '-')}.npz" for name in BAD_FILES}
    paths["text"].write_text("not weights")
    paths["nothing in it"].write_bytes(b"")
    np.save(paths["one array"].open("wb"), np.zeros(3))
    with zipfile.ZipFile(paths["another archive"], "w") as archive:
        archive.writestr("readme.txt", "hello")
    np.savez(paths["unknown configuration"], config=np.array(json.dumps({"colour": "red"})))
    np.savez(paths["configuration no dictionary"], config=np.array("[1, 2]"))
    np.savez(paths["pickled configuration"], config=np.array({"width": 8}, dtype=object))
    for name, key in (
        ("no configuration", "config"),
        ("no first layer", "stem.weight"),
        ("no last layer", "head.weight"),
    ):
        archive_without(paths[name], network, key)
    save_network(paths["other width"], network)
    with np.load(paths["other width"]) as archive:
        arrays = {key: archive[key] for key in archive.files}
    arrays["head.weight"] = np.zeros((1, 5), dtype=np.float32)
    np.savez(paths["other width"], **arrays)
    buffer = io.BytesIO()
    np.savez(buffer, config=np.array("{}"))
    paths["cut off"].write_bytes(buffer.getvalue()[:-30])
    return paths


BAD_FILES = (
    "missing",
    "text",
    "nothing in it",
    "one array",
    "another archive",
    "cut off",
    "unknown configuration",
    "configuration no dictionary",
    "pickled configuration",
    "no configuration",
    "no first layer",
    "no last layer",
    "other width",
)


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_weights_are_refused_by_name(tmp_path, name):
    path = bad_files(tmp_path)[name]
    with pytest.raises(nicmm.ArgumentError, match=path.name):
        load_network(path)
