"""Tests the network: guarantees for any weights, its switches, and weights files."""

import io
import json
import zipfile
from dataclasses import asdict, replace

import numpy as np
import pytest
import torch

import nicmm_core as nicmm
from nicmm_core.paper import weights_file
from nicmm_core.paper.network import (
    Network,
    NetworkConfig,
    NetworkInput,
    blocks,
    held_attention,
    initial_network,
    level_set,
    network_input,
    parameter_shapes,
    surface_attention,
)
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.tensors import input_tensors, trainable, trained
from nicmm_core.paper.weights_file import load_network, save_weights, shipped_network
from tests.core.checks import random_surface_points

SMALL = NetworkConfig(width=8, depth=2, gate_rank=2)
SWITCHES = ("attention", "gating", "normals", "control_indicator", "distance")
CPU = torch.device("cpu")


def random_network(config=SMALL, seed=0, channels=8):
    """A network with random weights, also in the last layer."""
    generator = np.random.default_rng(seed)
    parameters = {
        name: generator.normal(0.0, 0.5, shape).astype(np.float32)
        for name, shape in parameter_shapes(config, channels).items()
    }
    return Network(config, parameters)


def in_double(network):
    """The same network in double precision."""
    return Network(network.config, {k: v.astype(float) for k, v in network.parameters.items()})


def inputs_in_double(inputs):
    return NetworkInput(*(a.astype(float) if a.dtype == np.float32 else a for a in inputs))


@pytest.fixture(scope="module")
def inputs(small_ball):
    points = random_surface_points(small_ball, 4, seed=3)
    return network_input(build_problem(small_ball, points, "shortest"), SMALL)


def with_ninth(inputs, seed=5):
    ninth = np.random.default_rng(seed).random((len(inputs.features), 1), dtype=np.float32)
    return inputs._replace(features=np.concatenate([inputs.features, ninth], axis=1))


def count(network):
    return sum(parameter.size for parameter in network.parameters.values())


def test_untrained_network_returns_the_initial_distance(inputs):
    phi = level_set(initial_network(SMALL), inputs)
    np.testing.assert_array_equal(phi, inputs.initial_distance)


@pytest.mark.parametrize("config", [NetworkConfig(), replace(SMALL, attention=False, gating=False)])
def test_initial_network_has_the_shapes_of_its_configuration(config):
    network = initial_network(config, channels=9)
    assert network.channels == 9
    assert {k: v.shape for k, v in network.parameters.items()} == parameter_shapes(config, 9)
    assert all(array.dtype == np.float32 for array in network.parameters.values())


def test_initial_weights_depend_on_the_seed_only():
    first, second, other = (initial_network(SMALL, seed=seed) for seed in (1, 1, 2))
    assert_same_weights(first, second)
    assert not np.array_equal(first.parameters["stem.weight"], other.parameters["stem.weight"])


def test_initial_weights_lie_within_their_bound_and_see_positions_more():
    """Uniform within ±1/√in, and in the columns of the positions within that times the gain."""
    config = replace(SMALL, width=64, distance=False, position_gain=5.0)
    parameters = initial_network(config).parameters
    bound = 8**-0.5
    positions, others = np.split(np.abs(parameters["stem.weight"]), [3], axis=1)
    assert 4.5 * bound < positions.max() <= 5.0 * bound
    assert 0.9 * bound < others.max() <= bound
    assert 0.9 / 8 < np.abs(parameters["head.weight"]).max() <= 1 / 8


def test_output_is_zero_at_the_control_points_for_any_weights(inputs):
    for seed in range(3):
        phi = level_set(random_network(seed=seed), inputs)
        change = np.abs(phi - inputs.initial_distance).max()
        assert change > 1e-2
        assert np.abs(phi[inputs.control_vertices]).max() < 1e-6 * change


def test_single_precision_is_enough(inputs):
    network = load_network()
    exact = level_set(in_double(network), inputs_in_double(inputs))
    assert np.abs(level_set(network, inputs) - exact).max() < 1e-6


@pytest.mark.parametrize("config", [SMALL] + [replace(SMALL, **{s: False}) for s in SWITCHES])
def test_numpy_and_torch_agree(inputs, config):
    network, inputs = in_double(random_network(config)), inputs_in_double(inputs)
    tensors = level_set(trainable(network, CPU), input_tensors(inputs, CPU), xp=torch)
    assert tensors.dtype == torch.float64
    phi = level_set(network, inputs)
    np.testing.assert_allclose(tensors.detach(), phi, rtol=0, atol=1e-12)
    assert np.abs(phi).max() > 1e-2


def test_tensors_are_copies_that_come_back(inputs):
    network = random_network()
    tensors = trainable(network, CPU)
    returned = trained(tensors)
    assert_same_weights(returned, network)
    with torch.no_grad():
        tensors.parameters["head.bias"] += 1.0
    np.testing.assert_array_equal(returned.parameters["head.bias"], network.parameters["head.bias"])
    assert_same_weights(network, random_network())


def test_every_parameter_takes_part(inputs):
    network = trainable(random_network(), CPU)
    (level_set(network, input_tensors(inputs, CPU), xp=torch) ** 2).sum().backward()
    idle = [
        name
        for name, parameter in network.parameters.items()
        # A constant added everywhere is almost removed by the correction at the control points.
        if name != "head.bias" and not parameter.grad.abs().max() > 0.0
    ]
    assert not idle


def test_switches_remove_parameters(inputs):
    full = random_network()
    without_attention = random_network(replace(SMALL, attention=False))
    without_gating = random_network(replace(SMALL, gating=False))
    assert count(full) - count(without_attention) == SMALL.depth * SMALL.attention_kernel
    # A gate maps down to its rank and up to the width, and has a bias.
    assert count(full) - count(without_gating) == SMALL.depth * (2 * 8 * 2 + 8)
    for network in (without_attention, without_gating):
        assert np.isfinite(level_set(network, inputs)).all()


SWITCHED_CHANNELS = {"normals": [3, 4, 5], "control_indicator": [6], "distance": [7]}


@pytest.mark.slow
@pytest.mark.parametrize("switch", SWITCHED_CHANNELS)
def test_a_channel_switched_off_is_not_seen(small_ball, switch):
    points = random_surface_points(small_ball, 4, seed=3)
    problem = build_problem(small_ball, points, "shortest")
    features = problem.features.copy()
    features[:, SWITCHED_CHANNELS[switch]] += 0.3
    changed = replace(problem, features=features)
    on, off = SMALL, replace(SMALL, **{switch: False})
    for config, seen in ((on, True), (off, False)):
        network = random_network(config)
        first, second = (level_set(network, network_input(p, config)) for p in (problem, changed))
        assert np.array_equal(first, second) is not seen
    assert not np.array_equal(features, problem.features)
    zeros = network_input(problem, off).features[:, SWITCHED_CHANNELS[switch]]
    np.testing.assert_array_equal(zeros, 0.0)


def test_without_distance_the_output_knows_nothing_of_it(inputs):
    network = initial_network(replace(SMALL, distance=False))
    phi = level_set(network, inputs)
    reversed_distance = inputs._replace(initial_distance=-inputs.initial_distance)
    np.testing.assert_array_equal(phi, level_set(network, reversed_distance))
    assert np.abs(phi[inputs.control_vertices]).max() < 1e-5
    # At φ = 0 the energy has no gradient, so training could not start.
    assert np.abs(phi).max() > 1e-3


def test_without_attention_a_vertex_does_not_feel_the_others(inputs):
    """Except at the control points, only attention connects different vertices."""
    elsewhere = np.ones(len(inputs.features), dtype=np.float32)
    elsewhere[inputs.control_vertices] = 0.0
    elsewhere[0] = 0.0
    moved = inputs._replace(features=inputs.features + 0.3 * elsewhere[:, None])
    for attention in (False, True):
        network = random_network(replace(SMALL, attention=attention))
        change = level_set(network, moved)[0] - level_set(network, inputs)[0]
        assert (abs(change) > 1e-4) is np.bool_(attention)


def attention(inner, area_share):
    """Weights (C,) of the channels of one block."""
    kernel = np.array([0.7, -0.4, 0.9])
    network = Network(NetworkConfig(), {"blocks.0.attention.weight": kernel})
    return surface_attention(network, area_share)(0, inner)


def test_attention_by_hand():
    """The sigmoid of the correlation with the means, with zeros beyond the first and last."""
    weights = attention(np.array([[1.0, 2.0, 5.0], [3.0, 2.0, 1.0]]), np.array([0.75, 0.25]))
    mean = np.array([1.5, 2.0, 4.0])
    correlation = [
        -0.4 * mean[0] + 0.9 * mean[1],
        0.7 * mean[0] - 0.4 * mean[1] + 0.9 * mean[2],
        0.7 * mean[1] - 0.4 * mean[2],
    ]
    np.testing.assert_allclose(weights, 1.0 / (1.0 + np.exp(-np.array(correlation))), rtol=1e-12)


def test_attention_couples_neighbouring_channels_only():
    inner = np.random.default_rng(0).random((20, 12)) + 0.5
    share = np.full(20, 1 / 20)
    changed = inner.copy()
    changed[:, 5] += 1.0
    touched = np.abs(attention(inner, share) - attention(changed, share)) > 1e-5
    assert np.flatnonzero(touched).tolist() == [4, 5, 6]


def test_attention_sees_the_mean_over_the_area():
    """A vertex without area is ignored."""
    inner = np.random.default_rng(0).random((3, 6))
    share = np.array([0.5, 0.5, 0.0])
    changed = inner.copy()
    changed[2] += 10.0
    np.testing.assert_array_equal(attention(inner, share), attention(changed, share))


def test_held_attention_does_not_follow_the_values(inputs):
    """It gives the weights of the whole surface, also for a few vertices."""
    network = random_network()
    held = held_attention(network, inputs)
    free = surface_attention(network, inputs.area_share)
    for index, values in enumerate(blocks(network, inputs.features, free)):
        np.testing.assert_array_equal(held(index, values.activated), values.attention)
        np.testing.assert_array_equal(held(index, values.activated[:3]), values.attention)
    part = [values.output for values in blocks(network, inputs.features[:5], held)]
    whole = [values.output for values in blocks(network, inputs.features, free)]
    for few, many in zip(part, whole, strict=True):
        np.testing.assert_allclose(few, many[:5], rtol=0, atol=1e-5)


def test_gate_is_light():
    """The matrix of the gate has the given rank, and the gate lies between 0 and 1."""
    network = random_network(replace(SMALL, width=16, gate_rank=3), seed=1)
    for block in range(SMALL.depth):
        up, down = (
            network.parameters[f"blocks.{block}.gate_{way}.weight"] for way in ("up", "down")
        )
        assert np.linalg.matrix_rank(up @ down) == 3
    features = np.random.default_rng(0).uniform(-4.0, 4.0, (50, 8)).astype(np.float32)
    held = surface_attention(network, np.full(50, 0.02, dtype=np.float32))
    for values in blocks(network, features, held):
        assert values.gate.min() >= 0.0 and values.gate.max() <= 1.0
        assert np.ptp(values.gate) > 0.1
        np.testing.assert_allclose(
            values.output - values.hidden, values.gate * values.value, atol=1e-6
        )


def test_renumbering_the_vertices_renumbers_the_output(inputs):
    network = random_network()
    shuffle = np.random.default_rng(2).permutation(len(inputs.features))
    shuffled = NetworkInput(
        features=inputs.features[shuffle],
        initial_distance=inputs.initial_distance[shuffle],
        area_share=inputs.area_share[shuffle],
        response=inputs.response[shuffle],
        control_vertices=np.argsort(shuffle)[inputs.control_vertices],
    )
    expected = level_set(network, inputs)[shuffle]
    change = np.abs(level_set(network, shuffled) - expected).max()
    assert change < 1e-4 * np.abs(expected).max()


def test_area_shares_sum_to_one(inputs):
    assert inputs.area_share.sum() == pytest.approx(1.0, abs=1e-5)
    assert all(array.dtype == np.float32 for array in inputs[:4])


def assert_same_weights(first, second):
    assert first.config == second.config
    assert first.parameters.keys() == second.parameters.keys()
    for name, array in first.parameters.items():
        np.testing.assert_array_equal(array, second.parameters[name], name)


@pytest.mark.parametrize(
    "config",
    [NetworkConfig(width=8, depth=1, gate_rank=3, attention_kernel=5)]
    + [replace(SMALL, **{switch: False}) for switch in SWITCHES],
)
def test_weights_survive_the_file(tmp_path, config, inputs):
    network = random_network(config)
    save_weights(tmp_path / "weights.npz", network)
    loaded = load_network(tmp_path / "weights.npz")
    assert_same_weights(loaded, network)
    np.testing.assert_array_equal(level_set(loaded, inputs), level_set(network, inputs))


def test_files_without_input_switches_see_every_channel(tmp_path):
    network = random_network()
    config = {k: v for k, v in asdict(SMALL).items() if k not in SWITCHED_CHANNELS}
    config = np.array(json.dumps(config))
    np.savez(tmp_path / "weights.npz", config=config, **network.parameters)
    assert_same_weights(load_network(tmp_path / "weights.npz"), network)


def test_ninth_channel_starts_without_effect(inputs, tmp_path):
    network = random_network()
    save_weights(tmp_path / "weights.npz", network)
    loaded = load_network(tmp_path / "weights.npz", channels=9)
    first, second = (level_set(loaded, with_ninth(inputs, seed)) for seed in (5, 6))
    np.testing.assert_array_equal(first, second)
    np.testing.assert_allclose(first, level_set(network, inputs), rtol=1e-4, atol=1e-5)
    # Its weights have a gradient, so training can give it an effect.
    tensors = trainable(loaded, CPU)
    (level_set(tensors, input_tensors(with_ninth(inputs), CPU), xp=torch) ** 2).sum().backward()
    assert tensors.parameters["stem.weight"].grad[:, 8].abs().max() > 0.0


def test_shipped_weights_load_for_both_numbers_of_channels(inputs):
    for channels, features in ((8, inputs), (9, with_ninth(inputs))):
        phi = level_set(load_network(channels=channels), features)
        assert np.isfinite(phi).all()
        assert phi.shape == inputs.initial_distance.shape


def test_the_network_that_ships_for_maps_sees_them(inputs):
    network = shipped_network(9)
    painted = with_ninth(inputs)
    neutral = painted._replace(features=painted.features.copy())
    neutral.features[:, 8] = 1.0
    assert np.abs(level_set(network, painted) - level_set(network, neutral)).max() > 1e-3


def altered(path, **changes):
    """Write a weights file with some arrays changed, or omitted if None."""
    arrays = dict(random_network().parameters)
    arrays["config"] = np.array(json.dumps(asdict(SMALL)))
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
    altered(paths["gate larger than memory"], config=np.array(json.dumps({"gate_rank": 10**13})))
    altered(paths["width in words"], config=np.array(json.dumps({"width": "eight"})))
    altered(paths["no first layer"], **{"stem.weight": None})
    altered(paths["no last layer"], **{"head.weight": None})
    altered(paths["other width"], **{"head.weight": np.zeros((1, 5), dtype=np.float32)})
    altered(paths["another layer"], **{"tail.weight": np.zeros((1, 8), dtype=np.float32)})
    altered(paths["no attention"], **{"blocks.1.attention.weight": None})
    altered(paths["no gate"], **{"blocks.0.gate_up.bias": None})
    altered(paths["bias of the gate"], **{"blocks.0.gate_down.bias": np.zeros(2, np.float32)})
    altered(paths["turned matrix"], **{"blocks.0.gate_down.weight": np.zeros((8, 2), np.float32)})
    altered(paths["longer kernel"], **{"blocks.0.attention.weight": np.zeros(5, np.float32)})
    altered(paths["more channels"], **{"stem.weight": np.zeros((8, 9), np.float32)})
    deeper = json.dumps({**asdict(SMALL), "depth": 3})
    altered(paths["fewer blocks"], config=np.array(deeper))
    flat = {k: v for k, v in random_network().parameters.items() if not k.startswith("blocks")}
    np.savez(paths["no blocks"], config=np.array(json.dumps({"width": 8, "depth": 0})), **flat)
    altered(paths["layer in words"], **{"head.bias": np.array(["0.5"])})
    altered(paths["layer without axes"], **{"stem.weight": np.float32(1.0)})
    buffer = io.BytesIO()
    np.savez(buffer, config=np.array("{}"))
    paths["cut off"].write_bytes(buffer.getvalue()[:-30])
    save_weights(paths["bytes turned"], random_network())
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
    "gate larger than memory",
    "width in words",
    "no first layer",
    "no last layer",
    "other width",
    "another layer",
    "no attention",
    "no gate",
    "bias of the gate",
    "turned matrix",
    "longer kernel",
    "more channels",
    "fewer blocks",
    "no blocks",
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
        load_network(path)


def test_archives_that_unpack_to_too_much_are_refused_before(tmp_path, monkeypatch):
    monkeypatch.setattr(weights_file, "MOST_BYTES", 1_000_000)
    with zipfile.ZipFile(tmp_path / "zeros.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for index in range(3):
            archive.writestr(f"{index}.npy", bytes(500_000))
    with pytest.raises(nicmm.ArgumentError, match=r"zeros\.npz .* unpack to 1500000 bytes"):
        load_network(tmp_path / "zeros.npz")
