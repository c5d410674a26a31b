"""Wakes whoever holds a line open for somebody, when anybody's rights may have changed."""

import asyncio
import threading


class Bell:
    """Rung from any thread; waited for in event loops. Who is woken looks if it concerns him."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: set[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = set()
        self.rung = 0  # times; to be read before the rights are looked at

    def ring(self) -> None:
        """Wake all."""
        with self._lock:
            self.rung += 1
            for loop, event in self._waiting:
                loop.call_soon_threadsafe(event.set)

    async def wait(self, rung: int, seconds: float) -> None:
        """Until it has rung more often than that, or so long."""
        mine = (asyncio.get_running_loop(), asyncio.Event())
        with self._lock:
            if self.rung != rung:
                return
            self._waiting.add(mine)
        try:
            async with asyncio.timeout(seconds):
                await mine[1].wait()
        except TimeoutError:
            pass
        finally:
            with self._lock:
                self._waiting.discard(mine)
