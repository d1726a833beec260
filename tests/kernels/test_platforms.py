"""Recorded calls of kernels give the same bits when they are repeated from a program in C."""

import compile_library
import pytest

import nicmm_core as nicmm
from nicmm_core import shapes
from tests.kernels.platforms import compare


@pytest.fixture(scope="module")
def recording():
    return compare.record([lambda: nicmm.design_curve(shapes.sphere(1), [0, 5, 9])])


@pytest.mark.slow
def test_this_platform_repeats_recorded_calls(recording, tmp_path):
    name = compile_library.this_platform()
    results = compare.replay(name, recording, tmp_path / name)
    assert len(recording.kernels) > 10
    assert b"".join(recording.results) == results
    assert recording.first_difference(results) is None


def test_a_different_bit_is_found(recording):
    results = bytearray(b"".join(recording.results))
    assert recording.first_difference(bytes(results)) is None
    results[-1] ^= 1
    last = f"call {len(recording.called)} of {len(recording.called)}, of {recording.called[-1]}"
    assert recording.first_difference(bytes(results)) == f"{last}, differs"
    assert recording.first_difference(b"").startswith("call 1 of ")


def test_other_platforms_need_an_emulator(monkeypatch, recording, tmp_path):
    other = next(name for name in compare.EMULATORS if name != compile_library.this_platform())
    monkeypatch.setitem(compare.EMULATORS, other, ("no-such-emulator",))
    with pytest.raises(compare.CannotRunError, match="no-such-emulator is not installed"):
        compare.replay(other, recording, tmp_path / other)
