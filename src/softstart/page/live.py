"""Results that follow a slider: the newest machine wins, and nothing ever queues up.

A change only sets a flag. One task takes the inputs as they are when it gets there, computes the selected
strategy, sends it, and goes on with the others until the flag is set again. Frames that the browser has
not drawn yet are counted: with `WINDOW` of them on their way the task waits, and all changes meanwhile go
into the next frame. So the page is behind by a few frames at most, however slow browser or line are.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator

from softstart.page.frames import Frame, FrameBuilder
from softstart.page.sentences import log, sentence_of

WINDOW = 3  # frames sent and not yet drawn
# quick frames between two that were drawn, a second of a drag: more, and the browser is behind
MAX_QUICK = 60
PATIENCE = 1.0  # s, after which a frame that was never answered is taken as lost
REST = 0.12  # s without a change, after which what is slow or secondary is computed

__all__ = ["Frame", "Live"]


class Live:
    """Sends frames by `send(number, frame)` as long as `run` runs, the first one when it is poked.

    The browser's hello is that: fields built before it would be built again after it, and a hand that has
    taken a slider meanwhile would lose it. `poke` says that something changed, `drawn(number)` that the
    browser has drawn a frame. Frames are numbered from 1; a quick frame has the number 0 and is not answered.
    """

    def __init__(
        self,
        frames: FrameBuilder,
        send: Callable[[int, Frame], None],
        trouble: Callable[[str], None] = log.error,
    ) -> None:
        self._frames = frames
        self._send = send
        self._trouble = trouble
        self._changed = asyncio.Event()
        self._drawn = asyncio.Event()
        self._sent = self._answered = self._quick = 0

    def poke(self) -> None:
        """Something changed: the large figure is sent at once, the rest when its turn comes."""
        self._changed.set()
        if self._quick >= MAX_QUICK:
            return
        try:
            frame = self._frames.quick_frame()
        except Exception as error:  # shown with the frame that follows, if it persists
            log.debug("no quick frame", exc_info=error)
            return
        if frame is not None:
            self._quick += 1
            self._send(0, frame)

    def drawn(self, number: int) -> None:
        """The browser has drawn this frame, hence all before it."""
        self._answered = min(max(self._answered, number), self._sent)
        self._quick = 0
        self._drawn.set()

    @property
    def on_their_way(self) -> int:
        """Frames that were sent and are not drawn."""
        return self._sent - self._answered

    async def run(self) -> None:
        """Send frames from the first poke until cancelled. What goes wrong is shown and does not end it."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            try:
                await self._follow()
            except Exception as error:  # the page must live on, whatever a controller does
                self._trouble(sentence_of(error))

    async def _follow(self) -> None:
        await self._room()
        self._changed.clear()  # the frame below is of the present inputs
        self._put(self._frames.main_frame())
        if await self._going_on(self._frames.other_frames()):
            return
        try:
            await asyncio.wait_for(self._changed.wait(), REST)
        except TimeoutError:
            await self._going_on(self._frames.idle_frames())

    async def _going_on(self, steps: Iterator[Frame | None]) -> bool:
        """Take the steps one by one; True if something changed meanwhile, and the rest was left."""
        for frame in steps:
            if frame is not None:
                await self._room()
                self._put(frame)
            await asyncio.sleep(0)  # messages are read here
            if self._changed.is_set():
                return True
        return False

    def _put(self, frame: Frame) -> None:
        self._sent += 1
        self._send(self._sent, frame)

    async def _room(self) -> None:
        """Wait until fewer than WINDOW frames are on their way."""
        await asyncio.sleep(0)
        while self.on_their_way >= WINDOW:
            self._drawn.clear()
            try:
                await asyncio.wait_for(self._drawn.wait(), PATIENCE)
            except TimeoutError:
                self._answered, self._quick = self._sent, 0
