"""Where does a scanner stand that has measured these ranges? Gradients of rays lead there from a guess.

    python examples/gradients.py

Prints the place and draws gradients.png. Needs PyTorch.
"""

import numpy as np
import torch
from matplotlib.figure import Figure
from meshes import boxes
from pictures import BLUE, INK, ORANGE, bare, page, save

import wive
import wive.torch

ROOM = boxes(((-4, -3, 0), (4, 3, 2.5)))
SCANNER, GUESS = (1.5, -0.8, 1.2), (-1.5, 1.0, 1.2)


def beams(count: int = 72) -> torch.Tensor:
    """(n,3) directions of a level turn."""
    turn = torch.arange(count) * (2 * torch.pi / count)
    return torch.stack([torch.cos(turn), torch.sin(turn), 0 * turn], dim=1)


def descent(room: wive.Scene, measured: torch.Tensor, guess: tuple[float, float, float]) -> np.ndarray:
    """(steps,3) the places from the guess to where a scanner would measure these ranges."""
    place = torch.tensor(guess, requires_grad=True)
    optimizer = torch.optim.Adam([place], lr=0.1)
    steps = [place.detach().clone()]
    for _ in range(150):
        optimizer.zero_grad()
        ranges, _, _ = wive.torch.intersect(room, place.expand(len(measured), 3), beams(len(measured)))
        torch.nn.functional.mse_loss(ranges, measured).backward()
        optimizer.step()
        steps.append(place.detach().clone())
    return torch.stack(steps).numpy()


def draw(steps: np.ndarray, measured: np.ndarray) -> Figure:
    """The room from above, the beams, and the way of the guess."""
    figure = page()
    axes = bare(figure, (0.02, 0.02, 0.96, 0.96))
    axes.plot([-4, 4, 4, -4, -4], [-3, -3, 3, 3, -3], color=INK, linewidth=2)
    for end in np.array(SCANNER[:2]) + beams(len(measured)).numpy()[:, :2] * measured[:, None]:
        axes.plot([SCANNER[0], end[0]], [SCANNER[1], end[1]], color="#e2e6ea", linewidth=0.8, zorder=0)
    axes.plot(*steps[:, :2].T, "-o", color=ORANGE, markersize=2.5, linewidth=1)
    axes.plot(*SCANNER[:2], "*", color=BLUE, markersize=14)
    axes.annotate("guess", steps[0, :2], (-4, 8), textcoords="offset points", size=12, color=ORANGE)
    axes.annotate("scanner", SCANNER[:2], (10, -14), textcoords="offset points", size=12, color=BLUE)
    axes.set_aspect("equal")
    return figure


def main() -> None:
    """Measure, forget the place, find it again and draw the way."""
    room = wive.Scene(*ROOM)
    measured = torch.tensor(room.intersect(np.float32(SCANNER), beams().numpy()).t)
    steps = descent(room, measured, GUESS)
    print(f"the scanner stands at {steps[-1].round(2)}")
    save(draw(steps, measured.numpy()), __file__)


if __name__ == "__main__":
    main()
