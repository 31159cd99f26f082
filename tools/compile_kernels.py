"""Compile the loops, and every module and test, before several processes want the same at once.

python -m tools.compile_kernels

Short tests that between them call nearly every loop run here, each loop as machine code from its
first call. A loop that none of them calls is compiled where it is first worth it, as always. All
tests are collected: Python's code of each file, checked as tests have it, is then in its cache.
"""

from __future__ import annotations

import os
import sys

import pytest

from evertwin.compiled import functions

TESTS = (
    "src/evertwin/models/modelica/model.py",
    "src/evertwin/prognosis/laws/predict.py",
    "tests/ahead/test_path_error_of_an_arm.py"
    "::test_stiff_controllers_follow_and_soft_ones_fall_behind",
    "tests/anomaly/test_adwin.py::test_the_window_holds_what_it_says",
    "tests/correction/test_improve.py::test_an_extra_state_is_found",
    "tests/correction/test_improve.py::test_every_proposed_candidate_can_be_fitted",
    "tests/features/test_scan_matcher.py::test_a_blocked_lidar_has_no_pose_and_finds_back",
    "tests/loop/test_both_forms.py",
    "tests/loop/test_friction_laws.py::test_a_broken_run_goes_on_to_the_same_end",
    "tests/loop/test_one_way_in.py::test_a_checkpoint_goes_on_as_if_nothing_had_been",
    "tests/loop/test_real_machines.py::test_the_axis_runs_free_with_the_linear_law",
    "tests/loop/test_real_machines.py::test_the_box_gets_its_extra_state",
    "tests/models/fmu/test_bad_files.py::test_units_are_converted_and_missing_ones_told",
    "tests/models/fmu/test_faults.py::test_a_block_larger_than_the_shared_memory",
    "tests/models/fmu/test_fmu.py::test_an_fmu_in_python",
    "tests/service/test_warming.py",
)


class Short:
    """Of all tests these alone run.

    >>> Short.__name__
    'Short'
    """

    @staticmethod
    def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
        """Keeps them."""
        items[:] = [item for item in items if item.nodeid.startswith(TESTS)]


def main() -> int:
    """Exit code 0 if the tests pass."""
    os.environ["JAXTYPING_DISABLE"] = "1"
    functions.at_once()
    return pytest.main(["-q"], plugins=[Short()])


if __name__ == "__main__":
    sys.exit(main())
