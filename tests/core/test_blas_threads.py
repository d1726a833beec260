"""Tests the limit on BLAS threads: one thread inside, the former number afterwards."""

from threadpoolctl import threadpool_info, threadpool_limits

from nicmm_core.blas_threads import single_blas_thread


def blas_threads():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_one_thread_inside_and_the_former_number_after_an_error():
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        try:
            with single_blas_thread():
                assert blas_threads() == {1}
                raise KeyError
        except KeyError:
            pass
        assert blas_threads() == before


def test_contexts_that_overlap_leave_the_former_number():
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        first, second = single_blas_thread(), single_blas_thread()
        first.__enter__()
        second.__enter__()
        assert blas_threads() == {1}
        first.__exit__(None, None, None)
        second.__exit__(None, None, None)
        assert blas_threads() == before
