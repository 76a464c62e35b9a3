import signal

from signal_at_each_line import Ended, interrupted_at_each_line

from wzsumo.errors import ENDING_SIGNALS, uninterrupted


def handlers() -> list[object]:
    return [signal.getsignal(number) for number in ENDING_SIGNALS if number != signal.SIGTERM]  # its own is the one that acts


def test_all_handlers_come_back_wherever_a_signal_comes() -> None:
    """Also while they are put in place or back: one that stayed would swallow every later signal."""
    before, n = handlers(), 0

    def act() -> None:
        with uninterrupted() as interruptible, interruptible():
            pass

    for n in interrupted_at_each_line(act, files=("wzsumo/errors.py",)):
        assert handlers() == before, n
    assert n > 20


def test_signal_within_the_block_acts_at_its_end() -> None:
    done: list[str] = []

    def stop(_number: int, _frame: object) -> None:
        done.append("signal")
        raise Ended

    before = signal.signal(signal.SIGTERM, stop)
    try:
        with uninterrupted():
            signal.raise_signal(signal.SIGTERM)
            done.append("block")
    except Ended:
        done.append("ended")
    finally:
        signal.signal(signal.SIGTERM, before)
    assert done == ["block", "signal", "ended"]
