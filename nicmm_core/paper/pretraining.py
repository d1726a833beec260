"""Stage 1 (section 4.1): train one network on random sets of control points of one or more meshes.

For each set λ_smooth has the value that a design with these points would have (`losses.balanced`):
with one value for all sets, the minimum of most sets would be a flat φ. In every epoch the axes of
each set are permuted and reversed at random, since a few meshes have few orientations.
"""

from __future__ import annotations

import hashlib
import math
import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from ..errors import ArgumentError, UnreachableError
from ..geometry.array_types import FloatArray, IntArray
from ..geometry.mesh import Mesh
from ..geometry.surface_points import locate_control_points
from ..repair.clean_surface import without_doubled_faces
from ..repair.nonmanifold import manifold
from .features import BASE_CHANNELS
from .losses import EnergySurface, LossWeights, balanced, loss_terms, total_loss
from .network import (
    DISTANCE_CHANNEL,
    NORMAL_CHANNELS,
    POSITION_CHANNELS,
    Network,
    NetworkConfig,
    NetworkInput,
    initial_network,
    level_set,
    network_input,
)
from .problem import Problem, build_problem
from .tensors import input_tensors, surface_tensors, trainable, trained
from .torch_threads import single_thread
from .training_maps import random_maps
from .weights_file import save_weights

Report = Callable[[str, int, int, float], None]
"""Function of the stage, the numbers of sets done and in total, and the mean loss."""


@dataclass(frozen=True)
class PretrainingConfig:
    """Settings of stage 1; numbers of sets and points and the learning rate are the paper's.

    Attributes
    ----------
    sets : int
        Number of sets of control points, distributed evenly over the meshes.
    fewest_points, most_points : int
        Range of the number of points in a set.
    open_share : float
        Fraction of sets with an open curve.
    given_share : float
        Fraction of sets with a closed curve that visits the points in random order instead of the
        shortest order.
    map_share : float
        Fraction of sets with obstacles or lanes. If it is above 0, the network has φ_fea as its
        ninth channel, with neutral values in sets without maps.
    batch : int
        Number of sets per step.
    epochs : int
        Number of passes over all sets.
    learning_rate : float
        Initial learning rate of AdamW; it decreases to zero along a cosine.
    seed : int
        Seed of all random choices.
    """

    sets: int = 1000
    fewest_points: int = 3
    most_points: int = 5
    open_share: float = 0.35
    given_share: float = 0.15
    map_share: float = 0.0
    batch: int = 4
    epochs: int = 10
    learning_rate: float = 0.01
    seed: int = 0


@single_thread()
def pretrain(
    meshes: Sequence[Mesh],
    output: str | Path,
    network_config: NetworkConfig | None = None,
    config: PretrainingConfig | None = None,
    weights: LossWeights | None = None,
    progress: Report | None = None,
) -> list[float]:
    """Train on random control points of the meshes and write the weights (Eq. 9).

    A checkpoint is written beside the output after every epoch. An interrupted run resumes from it
    and ends with the same weights as a run without interruption.

    Parameters
    ----------
    meshes : sequence of Mesh
    output : path
        File for the weights, a ``.npz`` archive.
    network_config : NetworkConfig, optional
        Sizes and switches of the network.
    config : PretrainingConfig, optional
        Settings of the training.
    weights : LossWeights, optional
        Weights of the energy. λ_smooth is lowered for single sets, as for a design.
    progress : callable, optional
        Function called with the name of the stage, the number of sets processed in it, the total
        number to process (over all epochs), and the mean loss of the current epoch.

    Returns
    -------
    list of float
        Mean loss of every epoch.

    Raises
    ------
    ArgumentError
        If there are no meshes, if a mesh has too few vertices or too few sets with a path, if a
        setting is out of range, if the folder of the output does not exist, or if a checkpoint
        cannot be read or belongs to a run with other meshes or settings.
    """
    config = config or PretrainingConfig()
    weights = weights or LossWeights()
    report = progress or (lambda stage, done, total, loss: None)
    _check(meshes, output, config)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    channels = BASE_CHANNELS + (config.map_share > 0.0)
    network = trainable(initial_network(network_config, channels, config.seed), device)
    optimiser = torch.optim.AdamW(network.parameters.values(), lr=config.learning_rate)
    checkpoint = Path(output).with_suffix(".checkpoint.pt")
    configuration = repr((network.config, config, weights, _fingerprint(meshes)))
    losses = _resume(checkpoint, configuration, network, optimiser)

    # The tensors of a set on 4,000 vertices take about 2 MB, so all sets stay on the device.
    prepared = [
        _PreparedSet(
            surface_tensors(problem, device),
            input_tensors(network_input(problem, network.config), device),
            balanced(weights, problem),
        )
        for problem in _random_problems(meshes, config, report)
    ]
    for epoch in range(len(losses), config.epochs):
        for group in optimiser.param_groups:
            group["lr"] = _learning_rate(config, epoch)
        losses.append(_train_epoch(network, optimiser, prepared, config, epoch, report))
        _save_checkpoint(checkpoint, configuration, network, optimiser, losses)
    save_weights(output, trained(network))
    checkpoint.unlink(missing_ok=True)
    return losses


class _PreparedSet(NamedTuple):
    """A set of points on its surface, as tensors."""

    surface: EnergySurface
    inputs: NetworkInput
    weights: LossWeights


def _check(meshes: Sequence[Mesh], output: str | Path, config: PretrainingConfig) -> None:
    """Raise ArgumentError if training cannot begin."""
    if not meshes:
        raise ArgumentError("meshes is empty; name at least one mesh to train on")
    for name in ("sets", "batch", "epochs"):
        if getattr(config, name) < 1:
            raise ArgumentError(f"{name} is {getattr(config, name)}; at least 1 is needed")
    if not 3 <= config.fewest_points <= config.most_points:
        raise ArgumentError(
            f"fewest_points and most_points are {config.fewest_points} and {config.most_points}; "
            "a set needs at least 3 points, and at most as many as most_points"
        )
    shares = (config.open_share, config.given_share)
    if min(shares) < 0.0 or sum(shares) > 1.0:
        raise ArgumentError(
            f"open_share and given_share are {shares[0]} and {shares[1]}; they are shares of all "
            "sets, so neither may be negative, and their sum must not exceed 1"
        )
    if not 0.0 <= config.map_share <= 1.0:
        raise ArgumentError(f"map_share is {config.map_share}; it is a share of all sets, 0 … 1")
    if not Path(output).resolve().parent.is_dir():
        raise ArgumentError(f"output is {output}, whose folder does not exist; create it first")


def _train_epoch(
    network: Network,
    optimiser: torch.optim.Optimizer,
    prepared: list[_PreparedSet],
    config: PretrainingConfig,
    epoch: int,
    report: Report,
) -> float:
    """Train on all sets once, in random order, and return their mean loss."""
    generator = np.random.default_rng([config.seed, epoch])
    order = generator.permutation(len(prepared))
    total, done = 0.0, 0
    for first in range(0, len(order), config.batch):
        chosen = order[first : first + config.batch]
        optimiser.zero_grad()
        for index in chosen:
            each = prepared[index]
            phi = level_set(network, randomly_reoriented(each.inputs, generator), xp=torch)
            loss = total_loss(loss_terms(each.surface, phi), each.weights)
            (loss / len(chosen)).backward()
            total += loss.item()
            done += 1
            all_done = epoch * len(order) + done
            report("training", all_done, config.epochs * len(order), total / done)
        # Single sets with a bad loop would derail the training.
        torch.nn.utils.clip_grad_norm_(network.parameters.values(), 1.0)
        optimiser.step()
    return total / len(order)


def _save_checkpoint(
    checkpoint: Path,
    configuration: str,
    network: Network,
    optimiser: torch.optim.Optimizer,
    losses: list[float],
) -> None:
    """Save the state after an epoch.

    It is written under another name first: an interruption must not destroy the last checkpoint.
    """
    state = {
        "configuration": configuration,
        "network": network.parameters,
        "optimiser": optimiser.state_dict(),
        "losses": losses,
    }
    partial = checkpoint.with_suffix(".partial")
    torch.save(state, partial)
    partial.replace(checkpoint)


def randomly_reoriented(inputs: NetworkInput, generator: np.random.Generator) -> NetworkInput:
    """Permute and reverse the axes of a network input at random, and choose the sign of φ₀.

    The energy is invariant under both changes.
    """
    axes, signs = generator.permutation(3).tolist(), generator.choice([-1.0, 1.0], 3)
    side = float(generator.choice([-1.0, 1.0]))
    features = inputs.features.clone()
    for channels in (POSITION_CHANNELS, NORMAL_CHANNELS):
        features[:, channels] = inputs.features[:, channels][:, axes] * features.new_tensor(signs)
    features[:, DISTANCE_CHANNEL] *= side
    return inputs._replace(features=features, initial_distance=side * inputs.initial_distance)


def _learning_rate(config: PretrainingConfig, epoch: int) -> float:
    """Learning rate of an epoch: half a cosine wave from the initial rate to zero."""
    return config.learning_rate * 0.5 * (1.0 + math.cos(math.pi * epoch / config.epochs))


def _resume(
    checkpoint: Path, configuration: str, network: Network, optimiser: torch.optim.Optimizer
) -> list[float]:
    """Load the checkpoint of an interrupted run, if it exists; return the losses of its epochs."""
    if not checkpoint.exists():
        return []
    try:
        state = torch.load(checkpoint, weights_only=True)
        saved_configuration = state["configuration"]
    except (OSError, RuntimeError, EOFError, KeyError, TypeError, pickle.UnpicklingError) as error:
        raise ArgumentError(
            f"{checkpoint} cannot be read as a checkpoint ({error}); delete it to start over"
        ) from error
    if saved_configuration != configuration:
        raise ArgumentError(
            f"{checkpoint} belongs to a run with other meshes or settings; delete it to start "
            "over, or repeat that run"
        )
    with torch.no_grad():
        for name, tensor in network.parameters.items():
            tensor.copy_(state["network"][name])
    optimiser.load_state_dict(state["optimiser"])
    return list(state["losses"])


def _curve_kind(sample: float, config: PretrainingConfig) -> tuple[bool, str]:
    """Whether the curve of a set is closed, and the order of its points, from a random number."""
    if sample < config.open_share:
        return False, "shortest"
    return True, "given" if sample < config.open_share + config.given_share else "shortest"


def _fingerprint(meshes: Sequence[Mesh]) -> str:
    """Hash of the arrays of all meshes."""
    digest = hashlib.sha256()
    for mesh in meshes:
        digest.update(mesh.vertices.tobytes())
        digest.update(mesh.faces.tobytes())
    return digest.hexdigest()


def _random_problems(
    meshes: Sequence[Mesh],
    config: PretrainingConfig,
    report: Report,
) -> Iterator[Problem]:
    """Problems of random sets of vertices, evenly distributed over the meshes.

    Sets without a simple path are replaced.
    """
    done = 0
    per_mesh = np.diff(np.linspace(0, config.sets, len(meshes) + 1).astype(int))
    for number, (mesh, wanted) in enumerate(zip(meshes, per_mesh, strict=True)):
        generator = np.random.default_rng([config.seed, number])
        mesh = _manifold(mesh)
        component = np.bincount(mesh.face_component, weights=mesh.face_areas).argmax()
        vertices = np.unique(mesh.faces[mesh.face_component == component])
        if len(vertices) < config.most_points:
            raise ArgumentError(
                f"meshes[{number}] has {len(vertices)} connected vertices, fewer than a set's "
                f"{config.most_points} points; leave it out or use a finer mesh"
            )
        found = 0
        # A mesh is rejected after ten random sets for each set wanted.
        for _ in range(10 * wanted):
            if found == wanted:
                break
            count = generator.integers(config.fewest_points, config.most_points + 1)
            chosen = generator.choice(vertices, size=count, replace=False)
            closed, order = _curve_kind(generator.random(), config)
            points = locate_control_points(mesh, chosen, closed)
            obstacles, alignment = _maps(mesh, chosen, config, generator)
            try:
                problem = build_problem(mesh, points, order, obstacles, alignment, closed=closed)
            except UnreachableError:
                continue
            found += 1
            done += 1
            report("preparing", done, config.sets, 0.0)
            yield problem
        if found < wanted:
            raise ArgumentError(
                f"meshes[{number}]: only {found} of {wanted} random sets of points have a path "
                "through them; leave the mesh out or use a finer one"
            )


def _manifold(mesh: Mesh) -> Mesh:
    """A manifold with the same surface, on which problems can be built."""
    made = manifold(without_doubled_faces(mesh), np.arange(len(mesh.faces)), connected=False)
    return mesh if made is None else made.mesh


def _maps(
    mesh: Mesh, points: IntArray, config: PretrainingConfig, generator: np.random.Generator
) -> tuple[FloatArray | None, FloatArray | None]:
    """Weights of obstacles and alignment for a set; None if the network has no ninth channel."""
    if config.map_share == 0.0:
        return None, None
    if generator.random() < config.map_share:
        return random_maps(mesh, points, generator)
    nothing = np.zeros(len(mesh.vertices))
    return nothing, nothing
