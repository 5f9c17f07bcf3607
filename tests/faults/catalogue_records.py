"""Faults in files and pictures of rollouts."""

from __future__ import annotations

from tests.faults.fault import Fault

FILES = "tests/sim/record/test_formats.py"
RECORDING = "tests/sim/record/test_mcap.py"

RECORDS_FAULTS = (
    Fault(
        "cdr_numbers_are_not_aligned",
        "dynx.sim.record.cdr",
        right="self._put_bytes(bytes(-self._size % np.dtype(kind).itemsize))",
        wrong="self._put_bytes(bytes(-self._size % min(np.dtype(kind).itemsize, 4)))",
        caught_by=f"{RECORDING}::test_a_message_is_cdr_byte_for_byte",
    ),
    Fault(
        "cdr_strings_are_counted_in_letters",
        "dynx.sim.record.cdr",
        right="self.put_uint32(len(encoded) + 1)",
        wrong="self.put_uint32(len(text) + 1)",
        caught_by=f"{RECORDING}::test_a_floating_base_with_a_follower_and_names_of_all_letters",
    ),
    Fault(
        "recording_ends_before_the_last_state",
        "dynx.sim.record.ros_topics",
        right='        topic("/joint_states", state, joints(rollout.q, rollout.v), first=n),\n',
        wrong="",
        caught_by=f"{RECORDING}::test_every_number_of_a_fixed_base_is_found",
    ),
    Fault(
        "recording_has_a_frame_in_itself",
        "dynx.sim.record.ros_topics",
        right='world = "world" if base != "world" else "map"',
        wrong='world = "world"',
        caught_by=f"{RECORDING}::test_a_root_called_world_is_not_its_own_parent",
    ),
    Fault(
        "recording_cuts_nanoseconds_off",
        "dynx.sim.record.mcap_file",
        right="np.rint(rollout.t * 1e9).astype(np.int64)",
        wrong="(rollout.t * 1e9).astype(np.int64)",
        caught_by=f"{RECORDING}::test_stamps_are_the_times_in_whole_nanoseconds",
    ),
    Fault(
        "file_half_written_stays",
        "dynx.files.writing",
        right="            partial.unlink()\n",
        wrong="            pass\n",
        caught_by=f"{FILES}::test_a_full_disk_leaves_what_was_there",
    ),
    Fault(
        "file_of_wrong_shapes_is_read",
        "dynx.sim.record.formats",
        right="if array is not None and (array.shape != shape or array.dtype != kind):",
        wrong="if array is None:",
        caught_by=f"{FILES}::test_a_file_whose_parts_do_not_fit",
    ),
    Fault(
        "table_leaves_separators_in_names",
        "dynx.sim.record.csv_file",
        right="""if any(c in text for c in ',"\\n\\r') else text""",
        wrong="if False else text",
        caught_by=f"{FILES}::test_names_with_separators_stay_one_cell",
    ),
    Fault(
        "plot_shows_other_limits_than_those_that_cut",
        "dynx.sim.record.plot",
        right="return rollout.model.effort_limit if cut is None else np.asarray(cut, dtype=np.float64)",
        wrong="return rollout.model.effort_limit",
        caught_by=f"{FILES}::test_a_plot_draws_the_limits_that_cut",
    ),
)
