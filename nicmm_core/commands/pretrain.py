"""Train the network of the paper (its stage 1); needs PyTorch and tqdm.

Examples
--------
  nicmm shapes training-shapes --count 25
  nicmm pretrain training-shapes/*.obj --sets 500 --epochs 30 -o weights.npz
"""

from __future__ import annotations

import argparse

from ..errors import MissingPackageError
from ..io.files import read_mesh


def add(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments."""
    parser.add_argument("meshes", nargs="+", metavar="MESH")
    parser.add_argument("-o", "--output", required=True, metavar="WEIGHTS.npz")
    parser.add_argument("--sets", type=int, default=1000, help="sets of control points in all")
    parser.add_argument("--epochs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--maps", type=float, default=0.0, metavar="SHARE", help="share of sets with maps"
    )
    parser.add_argument("--no-attention", action="store_true", help="ablation: without ECA")
    parser.add_argument("--no-gating", action="store_true", help="ablation: without Light GLU")


def run(given: argparse.Namespace) -> None:
    """Train the network and write its weights."""
    try:
        import torch  # noqa: F401
        from tqdm import tqdm
    except ImportError as error:
        raise MissingPackageError(
            f"pretrain needs PyTorch and tqdm, which cannot be imported ({error}); install them "
            "into this Python with 'pip install torch tqdm'"
        ) from error

    from ..paper.network import NetworkConfig
    from ..paper.pretraining import PretrainingConfig, pretrain

    bars: dict[str, tqdm] = {}

    def report(stage: str, done: int, total: int, loss: float) -> None:
        if stage not in bars:
            bars[stage] = tqdm(total=total, desc=stage, unit="set")
        bar = bars[stage]
        if loss:
            bar.set_postfix(loss=f"{loss:.4f}", refresh=False)
        bar.update(done - bar.n)
        if done == total:
            bar.close()

    pretrain(
        [read_mesh(path) for path in given.meshes],
        given.output,
        NetworkConfig(attention=not given.no_attention, gating=not given.no_gating),
        PretrainingConfig(
            sets=given.sets, epochs=given.epochs, map_share=given.maps, seed=given.seed
        ),
        progress=report,
    )
