/* What the plugin in C++ and its Python side share. Python reads this file, too (../structs.py): declarations of the
   kinds that are here. */

#ifndef FIX_NOSQUISH_BRIDGE_H
#define FIX_NOSQUISH_BRIDGE_H

#include "cell.h"

#include <cstdint>

// what a hook returns; 0 is left by a callback that itself broke, as on an interrupt
enum Outcome { BROKEN = 0, DONE = 1, FAILED_ALIKE = 2, FAILED_HERE = 3 };

// what holds in a step, a bit each, as far as the plugin finds it or asks for it: see run/schedule.py, which has more
enum When { CALLED, SHOWN, VIRIAL_ASKED, TABLE, ENERGY, MOVES_BOX, PRESSURE, OTHER_BOX, LATE };

// cells for LAMMPS's arrays, by the kinds and names that they have in loops; see arrays.h, clusters.h, pressure.h, exchange.h
struct Arrays {
  F2 atom_x, atom_v, atom_f, atom_torque, atom_omega, atom_angmom, atom_mu, atom_virial, clusters, counted_f, arrived;
  F1 atom_mass, type_mass, virial;
  I1 groups, type;
  L1 origins, membership;
};

// what is to be known of another fix: see OtherFix in host.py
struct FixFacts {
  const char *id, *style;
  int32_t groupbit, time_integrate, between, end_of_step, nevery, integrates, box_change, called, constrains;
  int32_t has_energy, energy_in_pe, post_force, has_virial, virial_in_press, moves, varies, counts_heat;
};

// A loop that Python has bound to its arguments: the addresses of cells, a few integers each, which are a number, or an
// array's address and shape. A list of passes ends with one that has no loop.
struct Pass {
  int64_t (*loop)(const int64_t *cells);    // returns 0 if all is well
  const int64_t *cells;
};

// What is done at a hook, if the bodies are in one of these phases (a bit each) and bits of When are as they must be. A list of
// actions ends with one of no phase.
struct Action {
  int64_t phases;
  int64_t when, unless;    // all of these bits hold, and none of those
  const Pass *passes;      // null if Python does it, or nothing is done
  int64_t number;          // by which Python knows it; -1 if it has nothing to do
  int64_t then;            // the phase behind it, -1 if it stays
  int64_t sets, clears;    // bits that hold from now on, and that do no more
};

struct Bridge {
  int32_t checksum;    // of this file
  int32_t outcome;     // set by Python: how making the instance went
  // set by Python: what the instance has besides its methods
  int32_t wants_virial, wants_virial_per_atom;    // it fills these in
  // its attributes of these names, see run/declaration.py: it keeps a file beside restart files, it asks where its atoms were, so
  // many numbers go with one to another rank; and it is a rigid fix to those that ask for the bodies
  int32_t flips, needs_energy, couples, restart_file, follows_atoms, carries, rigid_flag;
  int32_t changes_box;      // in steps after each of which it changes the box: multiples of this, 0: never
  int32_t restart_size;     // numbers that go to restart files, and these
  double *restart_state;
  const double *kept_bodies;    // for restart files, or from one: three numbers of so many atoms, see bodies/membership.py
  int32_t kept_rows;
  const char *template_id;  // of the molecules that others insert, null for none
  const double *inserted;   // of each molecule that was inserted ten numbers, see host/hosts.py, until Python takes them
  int32_t insertions;       // how many these are
  int32_t vector_size, array_columns, array_rows;    // of what thermo_style and others read; rows are -1 if not known from the start
  const int32_t *vector_extensive;
  const char *names;    // of the scalar and of the values of the vector
  int32_t *body;        // of each local atom, -1 for none; null while not known
  double *masstotal;    // of each body
  // of the fix
  void *fix, *lammps;    // the fix is the first argument of the functions below
  const char *fix_id, *group, *line;    // the line is that of the script, from the fix's style on, a word a line
  double *virial, *virial_per_atom;     // the latter (natoms, 9)
  int32_t natoms;                       // -1 while LAMMPS asks for no virial per atom
  // steps: of the next output; first and last of the run; last of the run, whatever its keywords start and stop say
  const int64_t *next_output, *begin_step, *end_step, *last_step;
  int32_t vflag;        // what virial LAMMPS asks for in this step
  int32_t world;        // of a partition (lmp -partition), from 0 on
  double dmax;        // of min_modify, in a minimization; else 0
  int32_t min_dof;    // set by Python: how many coordinates of the bodies a minimization has
  int32_t ghost_velocity;     // ghost atoms have velocities in this run
  int32_t scalar_pressure;    // of the long-range forces only the mean pressure of all axes is known in this run
  int64_t changes;      // how many times the fix has changed the bodies by itself
  // the schedule: see run/schedule.py
  int32_t phase;          // where in a run the bodies are
  int64_t facts;          // bits of When that hold for longer than a step
  int64_t begins;         // the next step that Python begins, -1 for none
  int64_t energy_step;    // the next one at whose end Python needs the potential energy, -1 for none
  int32_t velocities_every, table_every;    // velocities are read, and a table is written, at the end of multiples of these; 0: never
  // lists of actions, null where there is nothing to do, or where Python follows the schedule
  const Action *at_setup, *at_begin, *at_exchange, *at_neighbor, *at_end;
  const Action *at_deform, *at_flipped;    // behind a change of the box by another fix; and to other vectors of the same lattice
  double *forces_virial;    // of all ranks and without this fix, where the box or its velocity changes next
  double *told_box;    // lowest and highest coordinates, tilts xy, xz, yz, for the passes deform and flipped
  double *rate;        // of the box vectors' components, in LAMMPS's order: xx yy zz yz xz xy
  int32_t stream_group;    // the bit of the group whose velocities change at periodic faces (fix deform remap v), or 0
  Arrays *arrays;
  int32_t rotor;   // whether the rotation is exact (1, 0) where the bodies that there are would choose otherwise, else -1
  int32_t held;    // the bit of the group whose atoms move with the box, if a fix shake or rattle holds some; else 0
  int32_t counts;    // in steps that tally the pressure: fill the cell counted_f, and leave what shake and rattle do out of the virial
  const int64_t *body_of, *displace, *state;    // cells of the bodies; null if there are none
  const double *array;    // set by Python: all of the global array, as long as it calls no hook and does no pass
  // external forces
  int32_t pushes;      // set by Python: call push when the forces of a step are known
  const char *words;    // set by Python: variables and columns whose values it needs there, with spaces between
  int32_t tells_energy, tells_virial;    // set by Python: what of these forces LAMMPS is to count
  double *values;    // of the words, one after the other, and how many each has: 0 for one that is for all bodies
  int32_t *sizes;
  double *told;    // their energy, and their virial on this rank
  // functions of the fix
  void (*log)(void *fix, const char *text);
  int (*nth_fix)(void *fix, int n, void *facts);    // 0 past the last; id is null for this fix
  const char *(*command)(void *fix);    // the words of the last command
  const char *(*definition)(void *fix, const char *word);    // of v_NAME, as info variables has it; of c_ID, the style, empty if its group is dynamic
  int64_t (*removed_freedom)(void *fix, const char *other, const char *group);    // by another fix
  void (*begin_step_of)(void *fix, const char *other);    // another fix does its initial_integrate
  int (*pair_style)(void *fix, const char *first);    // one that begins with this is in use, perhaps in a hybrid style
  void (*set_array_rows)(void *fix, int n);
  void (*point)(void *fix);    // point the cells for LAMMPS's arrays at them
  int64_t (*now)(void *fix);    // bits of When
  double (*potential)(void *fix);    // the potential energy of the last forces, the same on all ranks
  void (*ask_for_energy)(void *fix, int64_t step);    // have LAMMPS tally it in this step
  int (*go_back)(void *fix);    // move atoms by what is in place of their velocities, and compute forces; 1 if all is well
  int64_t (*set_box)(void *fix, const double *box);    // lowest and highest coordinates, xy, xz, yz
  int64_t (*find_clusters)(void *fix);    // fill the cell clusters
  int64_t (*flip_box)(void *fix, const double *box);    // the same, and of vectors that are added: a to b, a to c, b to c
  int64_t (*gravity)(void *fix, const char *other);    // address of the acceleration that another fix gives, 0 if it has none
  int (*particles)(void *fix, double *numbers);    // of each local atom 7: see bodies/extended.py; 0 if its style is not known
  int64_t (*orient_atom)(void *fix, int64_t atom, const double *quat);    // give a particle this orientation
  int (*molecule)(void *fix, int number, double *numbers);    // one of the template, 13: see templates.h; 0 if it is not known
  // methods of the instance, null where it has none
  int (*init)();
  int (*setup)(int vflag);
  int (*post_neighbor)();
  int (*min_store)();    // in a minimization: a line search begins; its addresses are of min_dof numbers
  int (*min_step)(double alpha, int64_t direction);
  int (*min_force)(int64_t forces);
  int (*max_alpha)(int64_t direction, double *alpha);
  int (*initial_integrate)(int vflag);
  int (*final_integrate)();
  int (*modify_external)(const char *words);    // of fix_modify, behind external
  int (*push)();
  int (*act)(int64_t number, int64_t found);    // an action, or what a pass of it has found wrong
  int (*initial_integrate_respa)(int vflag, int ilevel, int iloop);
  int (*final_integrate_respa)(int ilevel, int iloop);
  int (*reset_dt)();
  int (*end_of_step)();    // called with run_style respa only
  int (*post_run)();
  int (*write_restart_file)(const char *name);
  int (*keep_bodies)();      // have kept_bodies ready, on rank 0
  int (*write_restart)();    // have restart_state ready
  int (*zero_momentum)();
  int (*zero_rotation)();
  int (*reset_target)(double temperature);
  int (*rows_of_rank)(const char *words, int groupbit, int64_t *found);    // address and number of rows
  int (*dof)(int igroup, int64_t *count);
  int (*compute_scalar)(double *value);
  int (*compute_vector)(int i, double *value);
  int (*compute_array)(int i, int j, double *value);
  void (*release)(void *bridge);
  // set by a hook that fails, or by what makes the instance
  int32_t argument;    // of LAMMPS's fix command, that is wrong; -1 for none
  char message[4096];
};

#endif
