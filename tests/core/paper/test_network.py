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
    ChannelAttention,
    CurveNetwork,
    GatedUnit,
    NetworkConfig,
    NetworkInput,
)
from nicmm_core.paper.problem import build_problem
from nicmm_core.paper.tensors import network_input
from nicmm_core.paper.weights_file import load_network, save_weights, shipped_network
from tests.core.checks import random_surface_points

SMALL = NetworkConfig(width=8, depth=2, gate_rank=2)
SWITCHES = ("attention", "gating", "normals", "control_indicator", "distance")


def random_network(config=SMALL, seed=0, channels=8):
    """A network with random weights, also in the last layer."""
    network = CurveNetwork(config, channels)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.normal_(0.0, 0.5, generator=generator)
    return network


@torch.no_grad()
def output(network, inputs):
    return network(inputs)


@pytest.fixture(scope="module")
def inputs(small_ball):
    points = random_surface_points(small_ball, 4, seed=3)
    return network_input(build_problem(small_ball, points, "shortest"), torch.device("cpu"))


def with_ninth(inputs, seed=5):
    generator = torch.Generator().manual_seed(seed)
    ninth = torch.rand((len(inputs.features), 1), generator=generator)
    return inputs._replace(features=torch.cat([inputs.features, ninth], dim=1))


def count(network):
    return sum(parameter.numel() for parameter in network.parameters())


def test_untrained_network_returns_the_initial_distance(inputs):
    assert torch.equal(CurveNetwork(SMALL)(inputs), inputs.initial_distance)


def test_output_is_zero_at_the_control_points_for_any_weights(inputs):
    for seed in range(3):
        phi = output(random_network(seed=seed), inputs)
        change = (phi - inputs.initial_distance).abs().max()
        assert change > 1e-2
        assert phi[inputs.control_vertices].abs().max() < 1e-6 * change


def test_single_precision_is_enough(inputs):
    network = load_network()
    phi = output(network, inputs)
    exact = NetworkInput(*(t.double() if t.is_floating_point() else t for t in inputs))
    assert (phi - output(network.double(), exact)).abs().max() < 1e-6


def test_every_parameter_takes_part(inputs):
    network = random_network()
    (network(inputs) ** 2).sum().backward()
    idle = [
        name
        for name, parameter in network.named_parameters()
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
        assert output(network, inputs).isfinite().all()


SWITCHED_CHANNELS = {"normals": [3, 4, 5], "control_indicator": [6], "distance": [7]}


@pytest.mark.parametrize("switch", SWITCHED_CHANNELS)
def test_a_channel_switched_off_is_not_seen(inputs, switch):
    features = inputs.features.clone()
    features[:, SWITCHED_CHANNELS[switch]] += 0.3
    changed = inputs._replace(features=features)
    on = random_network()
    off = random_network(replace(SMALL, **{switch: False}))
    assert not torch.equal(output(on, changed), output(on, inputs))
    assert torch.equal(output(off, changed), output(off, inputs))


def test_without_distance_the_output_knows_nothing_of_it(inputs):
    torch.manual_seed(0)
    network = CurveNetwork(replace(SMALL, distance=False))
    phi = output(network, inputs)
    reversed_distance = inputs._replace(initial_distance=-inputs.initial_distance)
    assert torch.equal(phi, output(network, reversed_distance))
    assert phi[inputs.control_vertices].abs().max() < 1e-5
    # At φ = 0 the energy has no gradient, so training could not start.
    assert phi.abs().max() > 1e-3


def test_without_attention_a_vertex_does_not_feel_the_others(inputs):
    """Except at the control points, only attention connects different vertices."""
    elsewhere = torch.ones(len(inputs.features), dtype=torch.bool)
    elsewhere[inputs.control_vertices] = False
    elsewhere[0] = False
    moved = inputs._replace(features=inputs.features + 0.3 * elsewhere[:, None])
    for attention in (False, True):
        network = random_network(replace(SMALL, attention=attention))
        change = output(network, moved)[0] - output(network, inputs)[0]
        assert bool(change.abs() > 1e-4) is attention


@torch.no_grad()
def attention(inner, area_share):
    unit = ChannelAttention(3)
    unit.across.weight.copy_(torch.tensor([[[0.7, -0.4, 0.9]]]))
    return unit(inner, area_share)


def uniform(*shape):
    return torch.rand(shape, generator=torch.Generator().manual_seed(0))


def test_attention_couples_neighbouring_channels_only():
    inner = uniform(20, 12) + 0.5
    share = torch.full((20,), 1 / 20)
    changed = inner.clone()
    changed[:, 5] += 1.0
    before = attention(inner, share) / inner
    after = attention(changed, share) / changed
    # One weight per channel, the same at every vertex.
    torch.testing.assert_close(before, before[:1].expand(20, 12), rtol=0, atol=1e-6)
    touched = (before - after).abs().amax(dim=0) > 1e-5
    assert touched.nonzero().ravel().tolist() == [4, 5, 6]


def test_attention_sees_the_mean_over_the_area():
    """A vertex without area is ignored."""
    inner = uniform(3, 6)
    share = torch.tensor([0.5, 0.5, 0.0])
    changed = inner.clone()
    changed[2] += 10.0
    assert torch.equal(attention(inner, share)[:2], attention(changed, share)[:2])


@torch.no_grad()
def test_gate_is_light():
    """The matrix of the gate has the given rank, and the gate lies between 0 and 1."""
    unit = GatedUnit(16, 3)
    assert torch.linalg.matrix_rank(unit.gate_up.weight @ unit.gate_down.weight) == 3
    inner = 8.0 * uniform(50, 16) - 4.0
    share = unit(inner) / unit.value(inner)
    assert share.min() >= 0.0 and share.max() <= 1.0
    assert share.max() - share.min() > 0.1


def test_renumbering_the_vertices_renumbers_the_output(inputs):
    network = random_network()
    shuffle = torch.randperm(len(inputs.features), generator=torch.Generator().manual_seed(2))
    shuffled = NetworkInput(
        features=inputs.features[shuffle],
        initial_distance=inputs.initial_distance[shuffle],
        area_share=inputs.area_share[shuffle],
        response=inputs.response[shuffle],
        control_vertices=torch.argsort(shuffle)[inputs.control_vertices],
    )
    expected = output(network, inputs)[shuffle]
    change = (output(network, shuffled) - expected).abs().max()
    assert change < 1e-4 * expected.abs().max()


def assert_same_weights(first, second):
    assert first.config == second.config
    first, second = first.state_dict(), second.state_dict()
    assert list(first) == list(second)
    for name, array in first.items():
        assert torch.equal(array, second[name])


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
    assert torch.equal(output(loaded, inputs), output(network, inputs))


def test_files_without_input_switches_see_every_channel(tmp_path):
    network = random_network()
    config = {k: v for k, v in asdict(SMALL).items() if k not in SWITCHED_CHANNELS}
    arrays = {name: array.numpy() for name, array in network.state_dict().items()}
    np.savez(tmp_path / "weights.npz", config=np.array(json.dumps(config)), **arrays)
    assert_same_weights(load_network(tmp_path / "weights.npz"), network)


def test_ninth_channel_starts_without_effect(inputs, tmp_path):
    network = random_network()
    save_weights(tmp_path / "weights.npz", network)
    loaded = load_network(tmp_path / "weights.npz", channels=9)
    first, second = (output(loaded, with_ninth(inputs, seed)) for seed in (5, 6))
    assert torch.equal(first, second)
    torch.testing.assert_close(first, output(network, inputs), rtol=1e-4, atol=1e-5)
    # Its weights have a gradient, so training can give it an effect.
    (loaded(with_ninth(inputs)) ** 2).sum().backward()
    assert loaded.stem.weight.grad[:, 8].abs().max() > 0.0


def test_shipped_weights_load_for_both_numbers_of_channels(inputs):
    for channels, features in ((8, inputs), (9, with_ninth(inputs))):
        phi = output(load_network(channels=channels), features)
        assert phi.isfinite().all()
        assert phi.shape == inputs.initial_distance.shape


def test_the_network_that_ships_for_maps_sees_them(inputs):
    network = shipped_network(9)
    painted = with_ninth(inputs)
    neutral = painted._replace(features=painted.features.clone())
    neutral.features[:, 8] = 1.0
    assert (output(network, painted) - output(network, neutral)).abs().max() > 1e-3


def altered(path, **changes):
    """Write a weights file with some arrays changed, or omitted if None."""
    arrays = {name: array.numpy() for name, array in random_network().state_dict().items()}
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
