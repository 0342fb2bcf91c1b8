"""Work in turn, by several threads."""

import threading
import time
from collections.abc import Iterator

import pytest

from gcvec import parallel
from gcvec.parallel import in_shares, in_turn, use_workers


@pytest.fixture(autouse=True, params=[1, 2, 5])
def workers(request: pytest.FixtureRequest) -> Iterator[int]:
    use_workers(request.param)
    yield request.param
    use_workers(0)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 40])
def test_results_are_in_the_order_of_the_items(n: int) -> None:
    assert in_turn(lambda i: i * i, range(n)) == [i * i for i in range(n)]


@pytest.mark.parametrize("n", [0, 1, 3, 4, 1000])
def test_shares_are_the_same_whatever_the_number_of_threads(n: int) -> None:
    shares = in_shares(lambda first, last: (first, last), n)
    assert shares == [(n * k // 4, n * (k + 1) // 4) for k in range(4)]


def test_as_many_threads_work_as_there_are_workers(workers: int) -> None:
    """Each item waits until as many are being worked on."""
    barrier = threading.Barrier(workers, timeout=10)
    names = in_turn(lambda _: (barrier.wait(), threading.get_ident())[1], range(workers))
    assert len(set(names)) == workers


@pytest.mark.parametrize("bad", [0, 3, 7])
@pytest.mark.parametrize("problem", [IndexError, ZeroDivisionError, KeyboardInterrupt])
def test_what_goes_wrong_comes_out(bad: int, problem: type[BaseException]) -> None:
    """Wherever it does; and threads go on with the next work."""

    def work(i: int) -> int:
        if i == bad:
            raise problem
        return i

    with pytest.raises(problem):
        in_turn(work, range(8))
    assert in_turn(lambda i: i, range(8)) == list(range(8))


def test_what_was_said_before_holds_again(workers: int) -> None:
    with parallel.workers(3):
        assert parallel.threads() == 3
        assert in_turn(abs, [-1, -2]) == [1, 2]
    assert parallel.threads() == workers
    with pytest.raises(ZeroDivisionError), parallel.workers(4):
        raise ZeroDivisionError
    assert parallel.threads() == workers


def test_runs_at_the_same_time_have_their_own_threads(workers: int) -> None:
    begun, over = threading.Barrier(2, timeout=10), threading.Barrier(2, timeout=10)
    seen = {}

    def run(number: int) -> None:
        with parallel.workers(number):
            begun.wait()
            seen[number] = parallel.threads()
            over.wait()

    runs = [threading.Thread(target=run, args=(number,)) for number in (3, 4)]
    for one in runs:
        one.start()
    for one in runs:
        one.join()
    assert seen == {3: 3, 4: 4}
    assert parallel.threads() == workers


def test_after_a_failure_nothing_more_is_begun() -> None:
    begun = []

    def work(i: int) -> None:
        begun.append(i)
        if i == 20:
            raise ZeroDivisionError
        time.sleep(0.001)

    with pytest.raises(ZeroDivisionError):
        in_turn(work, range(1000))
    assert 20 < len(begun) < 100


def test_work_can_hand_out_work_of_its_own() -> None:
    assert in_turn(lambda i: sum(in_turn(lambda k: i * k, range(10))), range(10)) == [
        45 * i for i in range(10)
    ]
