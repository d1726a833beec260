"""Tests the network: guarantees for any weights, its switches, and weights files."""

import io
import json
import zipfile
from dataclasses import asdict, replace

import numpy as np
import pytest
import torch

import nicmm_core as nicmm
from nicmm_core.level_set.problem import build_problem
from nicmm_core.network import weights_file
from nicmm_core.network.forward_pass import (
    NetworkConfig,
    NetworkInput,
    NetworkWeights,
    channel_attention,
    gated_unit,
    level_set,
    linear,
    parameter_shapes,
)
from nicmm_core.network.single_pass import NUMPY, infer_level_set, network_input
from nicmm_core.network.trainable_network import TORCH, CurveNetwork, build_network, network_weights
from nicmm_core.network.weights_file import load_weights, save_weights, shipped_weights
from nicmm_core.status import Status
from tests.core.checks import random_surface_points

SMALL = NetworkConfig(width=8, depth=2, gate_rank=2)
SWITCHES = ("attention", "gating", "normals", "control_indicator", "distance")


def random_weights(config=SMALL, seed=0, channels=8):
    """Random weights, also in the last layer."""
    generator = np.random.default_rng(seed)
    return NetworkWeights(
        config,
        {
            name: (0.5 * generator.standard_normal(shape)).astype(np.float32)
            for name, shape in parameter_shapes(config, channels)
        },
    )


def output(weights, inputs):
    return level_set(weights, inputs, NUMPY)


def as_tensors(inputs):
    return NetworkInput(*(torch.as_tensor(array) for array in inputs))


@pytest.fixture(scope="module")
def problem(small_ball):
    points = random_surface_points(small_ball, 4, seed=3)
    return build_problem(small_ball, points, "shortest")


@pytest.fixture(scope="module")
def inputs(problem):
    return network_input(problem)


def with_ninth(inputs, seed=5):
    ninth = np.random.default_rng(seed).random((len(inputs.features), 1), dtype=np.float32)
    return inputs._replace(features=np.concatenate([inputs.features, ninth], axis=1))


def count(weights):
    return sum(array.size for array in weights.parameters.values())


def test_untrained_network_returns_the_initial_distance(inputs):
    tensors = as_tensors(inputs)
    assert torch.equal(CurveNetwork(SMALL)(tensors), tensors.initial_distance)


def test_output_is_zero_at_the_control_points_for_any_weights(inputs):
    for seed in range(3):
        phi = output(random_weights(seed=seed), inputs)
        change = np.abs(phi - inputs.initial_distance).max()
        assert change > 1e-2
        assert np.abs(phi[inputs.control_vertices]).max() < 1e-6 * change


@pytest.mark.parametrize("switch", [None, *SWITCHES])
def test_arrays_and_tensors_give_the_same(inputs, switch):
    """The network that PyTorch trains is the one that NumPy evaluates."""
    config = SMALL if switch is None else replace(SMALL, **{switch: False})
    weights = random_weights(config)
    expected = build_network(weights)(as_tensors(inputs)).detach().numpy()
    np.testing.assert_allclose(output(weights, inputs), expected, atol=1e-5 * expected.max())


def test_operations_of_both_libraries_agree():
    generator = np.random.default_rng(0)
    wide = np.linspace(-200.0, 200.0, 401, dtype=np.float32)
    np.testing.assert_allclose(NUMPY.sigmoid(wide), TORCH.sigmoid(torch.as_tensor(wide)), atol=1e-7)
    for channels, kernel in ((7, 1), (7, 3), (7, 5), (2, 5)):
        values = generator.random(channels, dtype=np.float32)
        weights = generator.random(kernel, dtype=np.float32)
        expected = TORCH.correlate(torch.as_tensor(values), torch.as_tensor(weights))
        np.testing.assert_allclose(NUMPY.correlate(values, weights), expected, rtol=1e-6)


def test_single_precision_is_enough(problem, inputs):
    areas = problem.elements.vertex_areas
    exact = NetworkInput(
        problem.features,
        problem.initial_distance,
        areas / areas.sum(),
        problem.smoother.response,
        problem.loop.control_vertices,
    )
    weights = load_weights()
    parameters = {name: array.astype(np.float64) for name, array in weights.parameters.items()}
    expected = output(NetworkWeights(weights.config, parameters), exact)
    assert expected.dtype == np.float64
    phi = output(weights, inputs)
    assert phi.dtype == np.float32
    assert np.abs(phi - expected).max() < 1e-6


def test_every_parameter_takes_part(inputs):
    network = build_network(random_weights())
    (network(as_tensors(inputs)) ** 2).sum().backward()
    idle = [
        name
        for name, parameter in network.weights.parameters.items()
        # A constant added everywhere is almost removed by the correction at the control points.
        if name != "head.bias" and not parameter.grad.abs().max() > 0.0
    ]
    assert not idle


def test_switches_remove_parameters(inputs):
    full = random_weights()
    without_attention = random_weights(replace(SMALL, attention=False))
    without_gating = random_weights(replace(SMALL, gating=False))
    assert count(full) - count(without_attention) == SMALL.depth * SMALL.attention_kernel
    # A gate maps down to its rank and up to the width, and has a bias.
    assert count(full) - count(without_gating) == SMALL.depth * (2 * 8 * 2 + 8)
    for weights in (without_attention, without_gating):
        assert np.isfinite(output(weights, inputs)).all()


SWITCHED_CHANNELS = {"normals": [3, 4, 5], "control_indicator": [6], "distance": [7]}


@pytest.mark.parametrize("switch", SWITCHED_CHANNELS)
def test_a_channel_switched_off_is_not_seen(inputs, switch):
    features = inputs.features.copy()
    features[:, SWITCHED_CHANNELS[switch]] += 0.3
    changed = inputs._replace(features=features)
    on = random_weights()
    off = random_weights(replace(SMALL, **{switch: False}))
    assert not np.array_equal(output(on, changed), output(on, inputs))
    np.testing.assert_array_equal(output(off, changed), output(off, inputs))


def test_without_distance_the_output_knows_nothing_of_it(inputs):
    torch.manual_seed(0)
    weights = network_weights(CurveNetwork(replace(SMALL, distance=False)))
    phi = output(weights, inputs)
    reversed_distance = inputs._replace(initial_distance=-inputs.initial_distance)
    np.testing.assert_array_equal(phi, output(weights, reversed_distance))
    assert np.abs(phi[inputs.control_vertices]).max() < 1e-5
    # At φ = 0 the energy has no gradient, so training could not start.
    assert np.abs(phi).max() > 1e-3


def test_without_attention_a_vertex_does_not_feel_the_others(inputs):
    """Except at the control points, only attention connects different vertices."""
    elsewhere = np.ones(len(inputs.features), dtype=bool)
    elsewhere[inputs.control_vertices] = False
    elsewhere[0] = False
    features = inputs.features + np.float32(0.3) * elsewhere[:, None]
    moved = inputs._replace(features=features)
    for attention in (False, True):
        weights = random_weights(replace(SMALL, attention=attention))
        change = output(weights, moved)[0] - output(weights, inputs)[0]
        assert bool(abs(change) > 1e-4) is attention


def attention(inner, area_share):
    across = np.array([[[0.7, -0.4, 0.9]]], dtype=np.float32)
    return channel_attention({"a.across.weight": across}, "a", inner, area_share, NUMPY)


def test_attention_couples_neighbouring_channels_only():
    inner = np.random.default_rng(0).random((20, 12), dtype=np.float32) + np.float32(0.5)
    share = np.full(20, 1 / 20, dtype=np.float32)
    changed = inner.copy()
    changed[:, 5] += 1.0
    before = attention(inner, share) / inner
    after = attention(changed, share) / changed
    # One weight per channel, the same at every vertex.
    np.testing.assert_allclose(before, np.broadcast_to(before[0], before.shape), atol=1e-6)
    touched = np.abs(before - after).max(axis=0) > 1e-5
    assert np.flatnonzero(touched).tolist() == [4, 5, 6]


def test_attention_sees_the_mean_over_the_area():
    """A vertex without area is ignored."""
    inner = np.random.default_rng(0).random((3, 6), dtype=np.float32)
    share = np.array([0.5, 0.5, 0.0], dtype=np.float32)
    changed = inner.copy()
    changed[2] += 10.0
    np.testing.assert_array_equal(attention(inner, share)[:2], attention(changed, share)[:2])


def test_gate_is_light():
    """The matrix of the gate has the given rank, and the gate lies between 0 and 1."""
    config = NetworkConfig(width=16, depth=1, gate_rank=3)
    parameters, name = random_weights(config).parameters, "blocks.0.gated"
    up, down = parameters[f"{name}.gate_up.weight"], parameters[f"{name}.gate_down.weight"]
    assert np.linalg.matrix_rank(up @ down) == 3
    inner = np.random.default_rng(0).standard_normal((50, 16)).astype(np.float32)
    value = linear(parameters, f"{name}.value", inner, NUMPY)
    share = gated_unit(parameters, name, inner, NUMPY) / value
    assert share.min() >= 0.0 and share.max() <= 1.0
    assert share.max() - share.min() > 0.1


def test_renumbering_the_vertices_renumbers_the_output(inputs):
    weights = random_weights()
    shuffle = np.random.default_rng(2).permutation(len(inputs.features))
    shuffled = NetworkInput(
        features=inputs.features[shuffle],
        initial_distance=inputs.initial_distance[shuffle],
        area_share=inputs.area_share[shuffle],
        response=inputs.response[shuffle],
        control_vertices=np.argsort(shuffle)[inputs.control_vertices],
    )
    expected = output(weights, inputs)[shuffle]
    np.testing.assert_allclose(
        output(weights, shuffled), expected, atol=1e-4 * np.abs(expected).max()
    )


def test_weights_without_numbers_give_the_initial_distance(problem):
    """The weights overflow during the computation, or are NaN from the start."""
    for bad in (1e38, np.nan):
        weights = random_weights()
        weights.parameters["head.weight"][:] = bad
        weights.parameters["head.bias"][:] = bad
        solution = infer_level_set(weights, problem)
        assert solution.status == Status.DIVERGED
        np.testing.assert_array_equal(solution.field, problem.initial_distance)
        assert all(np.isfinite(value) for value in solution.terms.values())


def test_single_pass_repeats_exactly(problem):
    first, second = (infer_level_set(load_weights(), problem) for _ in range(2))
    np.testing.assert_array_equal(first.field, second.field)
    assert first.terms == second.terms
    assert (first.status, first.iterations) == (Status.CONVERGED, 0)


def assert_same_weights(first, second):
    assert first.config == second.config
    assert list(first.parameters) == list(second.parameters)
    for name, array in first.parameters.items():
        np.testing.assert_array_equal(array, second.parameters[name])


@pytest.mark.parametrize(
    "config",
    [NetworkConfig(width=8, depth=1, gate_rank=3, attention_kernel=5)]
    + [replace(SMALL, **{switch: False}) for switch in SWITCHES],
)
def test_weights_survive_the_file_and_the_training(tmp_path, config):
    weights = random_weights(config)
    save_weights(tmp_path / "weights.npz", weights)
    loaded = load_weights(tmp_path / "weights.npz")
    assert_same_weights(loaded, weights)
    assert_same_weights(network_weights(build_network(loaded)), weights)


def test_training_does_not_change_the_weights_that_it_starts_from():
    weights = random_weights()
    network = build_network(weights)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
    assert_same_weights(weights, random_weights())


def test_files_without_input_switches_see_every_channel(tmp_path):
    weights = random_weights()
    config = {k: v for k, v in asdict(SMALL).items() if k not in SWITCHED_CHANNELS}
    np.savez(tmp_path / "weights.npz", config=np.array(json.dumps(config)), **weights.parameters)
    assert_same_weights(load_weights(tmp_path / "weights.npz"), weights)


def test_ninth_channel_starts_without_effect(inputs, tmp_path):
    weights = random_weights()
    save_weights(tmp_path / "weights.npz", weights)
    loaded = load_weights(tmp_path / "weights.npz", channels=9)
    first, second = (output(loaded, with_ninth(inputs, seed)) for seed in (5, 6))
    np.testing.assert_array_equal(first, second)
    np.testing.assert_allclose(first, output(weights, inputs), rtol=1e-4, atol=1e-5)
    # Its weights have a gradient, so training can give it an effect.
    network = build_network(loaded)
    (network(as_tensors(with_ninth(inputs))) ** 2).sum().backward()
    assert network.weights.parameters["stem.weight"].grad[:, 8].abs().max() > 0.0


def test_shipped_weights_load_for_both_numbers_of_channels(inputs):
    for channels, features in ((8, inputs), (9, with_ninth(inputs))):
        phi = output(load_weights(channels=channels), features)
        assert np.isfinite(phi).all()
        assert phi.shape == inputs.initial_distance.shape


def test_the_network_that_ships_for_maps_sees_them(inputs):
    weights = shipped_weights(9)
    painted = with_ninth(inputs)
    neutral = painted._replace(features=painted.features.copy())
    neutral.features[:, 8] = 1.0
    assert np.abs(output(weights, painted) - output(weights, neutral)).max() > 1e-3


def altered(path, **changes):
    """Write a weights file with some arrays changed, or omitted if None."""
    arrays = {"config": np.array(json.dumps(asdict(SMALL))), **random_weights().parameters}
    arrays.update(changes)
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})


def bad_files(folder):
    """Write invalid weights files; return their paths by defect."""
    paths = {name: folder / f"{name.replace(' ', '-')}.npz" for name in BAD_FILES}
    paths["text"].write_text("not weights")
    paths["nothing in it"].write_bytes(b"")
    np.save(paths["one array"].open("wb"), np.zeros(3))
    with zipfile.ZipFile(paths["another archive"], "w") as archive:
        archive.writestr("readme.txt", "hello")
    np.savez(paths["unknown configuration"], config=np.array(json.dumps({"colour": "red"})))
    np.savez(paths["configuration no dictionary"], config=np.array("[1, 2]"))
    np.savez(paths["pickled configuration"], config=np.array({"width": 8}, dtype=object))
    altered(paths["no configuration"], config=None)
    endless = json.dumps({**asdict(SMALL), "depth": 10**12})
    altered(paths["endless depth"], config=np.array(endless))
    altered(paths["width in words"], config=np.array(json.dumps({"width": "eight"})))
    altered(paths["no first layer"], **{"stem.weight": None})
    altered(paths["no last layer"], **{"head.weight": None})
    altered(paths["other width"], **{"head.weight": np.zeros((1, 5), dtype=np.float32)})
    altered(paths["another layer"], **{"tail.weight": np.zeros((1, 8), dtype=np.float32)})
    altered(paths["layer in words"], **{"head.bias": np.array(["0.5"])})
    altered(paths["layer without axes"], **{"stem.weight": np.float32(1.0)})
    buffer = io.BytesIO()
    np.savez(buffer, config=np.array("{}"))
    paths["cut off"].write_bytes(buffer.getvalue()[:-30])
    save_weights(paths["bytes turned"], random_weights())
    content = bytearray(paths["bytes turned"].read_bytes())
    middle = len(content) // 2
    content[middle : middle + 40] = bytes(value ^ 255 for value in content[middle : middle + 40])
    paths["bytes turned"].write_bytes(content)
    with zipfile.ZipFile(paths["array larger than memory"], "w") as archive:
        header = io.BytesIO()
        description = {"descr": "<f4", "fortran_order": False, "shape": (10**15,)}
        np.lib.format.write_array_header_1_0(header, description)
        archive.writestr("config.npy", header.getvalue())
    altered(paths["not a number"], **{"head.bias": np.array([np.nan], dtype=np.float32)})
    for name, method in (("lzma garbage", zipfile.ZIP_LZMA), ("old header", zipfile.ZIP_STORED)):
        with zipfile.ZipFile(paths[name], "w", method) as archive:
            archive.writestr("config.npy", b"\x93NUMPY\x01\x00\x10\x00{'shape': (3L,,}" * 9)
    content = bytearray(paths["lzma garbage"].read_bytes())
    content[60:90] = bytes(30)
    paths["lzma garbage"].write_bytes(content)
    return paths


BAD_FILES = (
    "missing",
    "text",
    "nothing in it",
    "one array",
    "another archive",
    "cut off",
    "bytes turned",
    "array larger than memory",
    "unknown configuration",
    "configuration no dictionary",
    "pickled configuration",
    "no configuration",
    "endless depth",
    "width in words",
    "no first layer",
    "no last layer",
    "other width",
    "another layer",
    "layer in words",
    "layer without axes",
    "not a number",
    "lzma garbage",
    "old header",
)


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_weights_are_refused_by_name(tmp_path, name):
    path = bad_files(tmp_path)[name]
    with pytest.raises(nicmm.ArgumentError, match=path.name):
        load_weights(path)


def test_archives_that_unpack_to_too_much_are_refused_before(tmp_path, monkeypatch):
    monkeypatch.setattr(weights_file, "MOST_BYTES", 1_000_000)
    with zipfile.ZipFile(tmp_path / "zeros.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for index in range(3):
            archive.writestr(f"{index}.npy", bytes(500_000))
    with pytest.raises(nicmm.ArgumentError, match=r"zeros\.npz .* unpack to 1500000 bytes"):
        load_weights(tmp_path / "zeros.npz")
