"""Section `streams`: hits of other libraries' arrays and streams, of CUDA graphs and of users' kernels.

Each attempt runs in a process of its own: after an illegal address every later CUDA call of a process fails.
"""

import time
from multiprocessing import get_context
from multiprocessing.connection import Connection

from bench.gpu.attempts import ATTEMPTS, Case, hard_case
from bench.gpu.session import Session
from bench.support.report import Row

RAYS, FEW_RAYS = 100_000, 500
LONGEST_ATTEMPT = 90.0  # seconds


def run(session: Session) -> list[Row]:
    """One row per attempt: how many numbers of which answers are wrong, or why it failed."""
    rows: list[Row] = []
    mesh = session.mesh(session.names[0])
    case = hard_case(mesh.vertices, mesh.faces, session.device, session.count(RAYS, FEW_RAYS))
    for name, attempt in ATTEMPTS.items():
        if attempt.needs_gpu and not session.on_gpu:
            continue
        start = time.perf_counter()
        limit = max(1.0, min(LONGEST_ATTEMPT, session.seconds_left()))
        row = {"attempt": name, **alone(name, case, limit)}
        rows.append({**row, "seconds": round(time.perf_counter() - start, 1)})
        print("streams", rows[-1], flush=True)
    return rows


def alone(name: str, case: Case, limit: float) -> Row:
    """What the attempt finds in a process of its own, which has so many seconds."""
    context = get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(sender, name, case))
    process.start()
    sender.close()
    try:
        found: Row = receiver.recv() if receiver.poll(limit) else {"failed": f"no answer in {limit:.0f} s"}
    except EOFError:
        process.join()
        found = {"failed": f"the process ended with status {process.exitcode}"}
    process.kill()
    process.join()
    return found


def _send(sender: Connection, name: str, case: Case) -> None:
    try:
        sender.send({"wrong": ATTEMPTS[name].work(case)})
    except Exception as problem:
        sender.send({"failed": f"{type(problem).__name__}: {problem}"[:300]})
