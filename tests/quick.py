"""The tests of `pytest -m quick`: of each subject the fastest that decide,
for those who change something small.

A subject has what breaks first if it is wrong, on one rank and on more where ranks matter, and one
test of each way to start LAMMPS. Left out are statistics, long runs, and what differs from a test
here in its numbers alone. A name without brackets stands for all cases of a test.
"""

QUICK = {
    "rotation": """
        test_rotor.py::test_reference_matrices
        test_rotor.py::test_equals_the_paper
        test_rotor.py::test_each_rotation_to_four_ulp
        test_rotor.py::test_kinds_side_by_side""",
    "units": """
        test_units.py::test_motion_is_that_of_rigid_nve[lj]
        test_units.py::test_motion_is_that_of_rigid_nve[real]
        test_units.py::test_motion_is_that_of_rigid_nve[metal]
        test_units.py::test_motion_is_that_of_lj_units[real]
        test_units.py::test_motion_is_that_of_lj_units[si]""",
    "motion beside rigid/nve": """
        test_nve.py::test_water_moves_as_with_rigid_nve[1]
        test_nve.py::test_water_moves_as_with_rigid_nve[2]
        test_nve.py::test_bodies_move_as_with_rigid_nve[cube-1]
        test_nve.py::test_bodies_move_as_with_rigid_nve[triclinic-4]
        test_nve.py::test_bodies_move_as_with_rigid_nve[plane-1]
        test_nve.py::test_difference_from_rigid_nve_is_of_second_order[pair row]
        test_nve.py::test_order_of_axes
        test_nve.py::test_body_styles
        test_nve.py::test_start_velocities[1]
        test_nve.py::test_migration[(1, 2, 1)]""",
    "temperature and pressure": """
        test_nve.py::test_temperature_of_a_mixture[3-1]
        test_nve.py::test_pressure_at_step_0[3-1]
        test_nve.py::test_pressure_does_not_depend_on_place[0.3-2]
        test_hmc.py::test_rejected[box-2]""",
    "minimization": """
        test_minimize.py::test_dimer[cg]
        test_minimize.py::test_minimize_with_components_off
        test_minimize.py::test_unchanged_script_with_minimize""",
    "boxes and domains": """
        test_domains.py::test_boxes[tilted-2]
        test_domains.py::test_body_of_many_atoms[2]""",
    "ranks that share bodies": """
        test_sharing.py::test_ranks[2]
        test_sharing.py::test_ranks[4]
        test_sharing.py::test_one_rank_needs_no_mpi4py""",
    "compiled loops": """
        test_compiled.py::test_a_loop_computes_what_python_computes
        test_compiled.py::test_wrong_arguments
        test_compiled.py::test_later_runs_do_without_numba""",
    "keywords": """
        test_keywords.py::test_unreadable_words
        test_keywords.py::test_force_and_torque[molecule one]
        test_keywords.py::test_reinit[yes-1-velocities new]
        test_keywords.py::test_infile[molecule-2]
        test_keywords.py::test_wrong_infile[unknown body]
        test_keywords.py::test_sphere_in_a_group
        test_words.py::test_each_keyword_has_a_row
        test_words.py::test_keywords_of_other_fixes
        test_output.py::test_values
        test_output.py::test_same_on_any_number_of_ranks[2]""",
    "bad input": """
        test_bad_input.py::test_ends_on_two_ranks[no words at all]
        test_bad_input.py::test_ends_on_two_ranks[keyword that does not exist]
        test_bad_input.py::test_ends_on_two_ranks[force that becomes NaN]
        test_bad_input.py::test_ends_on_two_ranks[atoms lost]
        test_bad_input.py::test_ends_on_two_ranks[exception of its own]
        test_bad_input.py::test_ends_on_one_rank[library-keyword that does not exist]
        test_bad_input.py::test_change_between_runs[delete_atoms group odd]""",
    "other fixes, respa": """
        test_other_fixes.py::test_velocities_changed_by_fixes[1]
        test_respa.py::test_equal_steps_are_verlet[one level]""",
    "in place of fix rigid's": """
        test_from_rigid.py::test_gravity[fix-1]
        test_suffix.py::test_velocity_zero""",
    "runs in a row, restart": """
        test_scripts.py::test_rerun[2]
        test_scripts.py::test_rerun_of_rounded_places[1]
        test_restart.py::test_continued[cube]
        test_waiting.py::test_readers_find_velocities""",
    "plugin": """
        test_plugin.py::test_equals_fix_nve
        test_plugin.py::test_error_on_one_rank_ends_all[init-lmp]
        test_plugin.py::test_run_error_everywhere_is_one_message[initial_integrate-lmp]
        test_plugin.py::test_library_user_gets_an_exception
        test_plugin.py::test_values_for_thermo[2]""",
    "another LAMMPS": """
        test_build.py::test_another_update
        test_own_fix.py::test_trajectory
        test_own_fix.py::test_runs_in_a_row[1]
        test_own_fix.py::test_bad_input_ends_all_ranks[no words at all]""",
    "validation": """
        test_statistics.py::test_distance_ignores_periodic_images
        test_running.py::test_thermo_table
        test_running.py::test_a_crash_is_a_result
        test_statistics.py::test_margin_of_few_is_students[2-12.706]
        test_running.py::test_help_is_instant
        test_store.py::test_made_once
        test_store.py::test_origin_is_all_that_counts
        test_store.py::test_code_that_measures_counts
        test_cost.py::test_ratios_are_of_one_round
        test_claims.py::test_form_sees_what_is_not_symplectic
        test_stress.py::test_verdicts
        test_compare_choice.py::test_choice_is_that_of_a_search
        test_report.py::test_terminal_files_and_page""",
    "documentation": """
        test_docs.py::test_readme_has_the_committed_table
        test_docs.py::test_tutorial""",
    "the suite itself": """
        test_suite.py::test_imports_what_is_installed[module]
        test_suite.py::test_quick_tests_are_there""",
}
NAMES = {name.strip() for names in QUICK.values() for name in names.strip().split("\n")}


def name(item):
    """The one of NAMES that a test has, its file's, its own or its case's, or nothing."""
    file, _, case = f"{item.path.name}::{item.nodeid.partition('::')[2]}".partition("::")
    return next(iter(NAMES & {file, f"{file}::{case.partition('[')[0]}", f"{file}::{case}"}), None)
