"""A process that computes chunks: tasks come over standard input, answers go over standard output."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import traceback
from typing import IO, Any

COMMAND = "from softstart.sweeping.worker import main; main()"


def answer(task: Any) -> Any:
    """Compute a chunk; write it if the task says where, hand it back otherwise."""
    from softstart.sweeping.starts import compute

    block = compute(task)
    if not task.keep_in:
        return block
    from softstart.sweeping.store import write_block

    write_block(task.keep_in, task.place, block)
    return None


def serve(questions: IO[bytes], answers: IO[bytes]) -> None:
    """Answer with (True, block) or (False, error) until the questions end."""
    sys.path[:] = pickle.load(questions)  # as where the tasks come from: the same modules are found
    while True:
        try:
            task = pickle.load(questions)
        except EOFError:
            return
        except Exception as error:
            said: tuple[bool, Any] = (False, error)
        else:
            try:
                said = (True, answer(task))
            except Exception as error:  # of any kind: it belongs to whoever asked
                error.add_note("".join(traceback.format_exception(error)))
                said = (False, error)
        try:
            sent = pickle.dumps(said)
        except Exception:
            sent = pickle.dumps((False, RuntimeError(f"{type(said[1]).__name__}: {said[1]}")))
        answers.write(sent)
        answers.flush()


def main() -> None:
    """The process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever asks is interrupted, and ends this one
    with os.fdopen(os.dup(1), "wb") as channel:
        os.dup2(2, 1)  # what a controller prints must not get between the answers
        try:
            serve(sys.stdin.buffer, channel)
        except (EOFError, BrokenPipeError):
            return  # nobody asks any more
