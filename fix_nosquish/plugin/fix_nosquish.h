/* The fix: its hooks, which call its parts or Python. Those of a step are in fix_nosquish.cpp. */

#ifndef FIX_NOSQUISH_FIX_NOSQUISH_H
#define FIX_NOSQUISH_FIX_NOSQUISH_H

#include "arrays.h"
#include "bridge.h"
#include "exchange.h"
#include "external.h"
#include "other_fixes.h"
#include "failures.h"
#include "forces.h"
#include "interpreter.h"
#include "molecules.h"
#include "particles.h"
#include "pressure.h"
#include "restart.h"

#include "citeme.h"
#include "group.h"
#include "update.h"

#include <string>
#include <vector>

namespace {
namespace nosquish {

class FixNosquish : public Fix {
 public:
  FixNosquish(LAMMPS *, int, char **);

  // the hooks of a step
  void setup(int) override;
  void setup_post_neighbor() override { post_neighbor(); }
  void post_neighbor() override;
  void setup_pre_reverse(int, int) override { pressure.store_counted_forces(); }
  void pre_reverse(int, int) override { pressure.store_counted_forces(); }
  void pre_exchange() override { perform(bridge.at_exchange); }
  void post_force(int) override { arrays.store_forces(); }
  void initial_integrate(int) override;
  void final_integrate() override;
  void initial_integrate_respa(int, int, int) override;
  void final_integrate_respa(int, int) override;
  void end_of_step() override;

  // the hooks of a minimization; the coordinates of bodies are degrees of freedom of this fix
  void begin_minimization();
  void min_setup(int vflag) override
  {
    if (bridge.dmax) setup(vflag), bridge.vflag = 0;    // which has computed the virial
  }
  void min_post_neighbor() override { post_neighbor(); }
  void min_post_force(int) override;
  double min_energy(double *) override;
  void min_store() override { call(bridge.min_store); }
  void min_step(double alpha, double *direction) override { call(bridge.min_step, alpha, address(direction)); }
  double max_alpha(double *direction) override { return query<double>(bridge.max_alpha, address(direction)); }
  int min_dof() override { return bridge.min_dof; }

  // before and after a run, and between runs
  int setmask() override;
  int modify_param(int, char **) override;
  void init() override;
  void post_run() override;
  void write_restart_file(const char *name) override { call(bridge.write_restart_file, name); }
  void write_restart(FILE *) override;
  void restart(char *buffer) override { state.read(buffer); }
  void reset_dt() override { call(bridge.reset_dt); }
  void deform(int) override;
  void zero_momentum() override { call(bridge.zero_momentum); }
  void zero_rotation() override { call(bridge.zero_rotation); }
  void reset_target(double temperature) override { call(bridge.reset_target, temperature); }

  // what LAMMPS and other styles ask
  bigint dof(int group) override { return query<int64_t>(bridge.dof, group); }
  double compute_scalar() override { return query<double>(bridge.compute_scalar); }
  double compute_vector(int) override;
  double compute_array(int, int) override;
  void *extract(const char *, int &) override;
  double memory_usage() override { return exchange.bytes(); }
  double kinetic_energy(int which) { return query<double>(bridge.compute_vector, which); }    // of translation (0) or rotation (1)
  int rows_of_rank(const char *words, int group, double *&values);

  // atoms
  void grow_arrays(int n) override { exchange.grow(n); }
  void copy_arrays(int i, int j, int) override { exchange.copy(i, j); }
  void set_arrays(int i) override { exchange.reset(i); }
  int pack_exchange(int i, double *buffer) override { return exchange.pack(i, buffer); }
  int unpack_exchange(int i, double *buffer) override { return exchange.unpack(i, buffer); }
  int pack_reverse_comm(int n, int first, double *buffer) override { return pressure.pack(n, first, buffer); }
  void unpack_reverse_comm(int n, int *list, double *buffer) override { pressure.unpack(n, list, buffer); }
  int pack_forward_comm(int n, int *list, double *buffer, int, int *) override { return clusters.pack(n, list, buffer); }
  void unpack_forward_comm(int n, int first, double *buffer) override { clusters.unpack(n, first, buffer); }
  void set_molecule(int before, tagint tag, int number, double *, double *velocity, double *quat) override
  {
    molecules.add(before, tag, number, velocity, quat);
  }

 private:
  struct Instance : Bridge {    // ends with the instance of the class
    Instance() : Bridge() {}
    ~Instance()
    {
      if (release) release(static_cast<Bridge *>(this));
    }
  };

  Failures failures{lmp, this, bridge};
  Instance bridge;
  OtherFixes others{lmp, this, bridge};
  Exchange exchange{lmp, this, bridge};
  AtomArrays arrays{lmp, this, bridge};
  Molecules molecules{lmp, this, bridge};
  Particles particles{atom};
  Box box{lmp, this, bridge};
  Clusters clusters{lmp, this, bridge};
  Pressure pressure{lmp, this, bridge};
  PotentialEnergy energy{lmp, this, bridge};
  GoingBack back{lmp, this, bridge};
  External external{lmp, this, bridge};
  Restart state{lmp, this, bridge};
  bool respa = false, minimized = false;    // the forces on the atoms of bodies were set to zero
  std::vector<int> extensive;
  std::vector<double> of_atoms;    // the virial of each atom, nine numbers

  void fill_bridge(), declare(), apply_external(), note_remapping_box();
  int64_t set_box(const double *);
  static int64_t address(double *numbers) { return reinterpret_cast<int64_t>(numbers); }
  void point()
  {
    if (bridge.arrays) arrays.point(exchange);
  }
  void set_array_rows(int n) { size_array_rows = n; }
  int64_t now() const;
  bool perform(const Action *);
  bool go_back();

  // Run a list of passes; returns the first result that is not 0, or 0.

  int64_t run_passes(const Pass *pass)
  {
    if (!pass) return 0;
    bridge.array = nullptr;    // it changes
    for (; pass->loop; pass++) {
      const int64_t result = pass->loop(pass->cells);
      failures.rethrow();
      if (result) return result;
    }
    bridge.changes++;
    return 0;
  }

  // Call a method of the class, if it has it. End the run if it fails.

  template <typename... Types, typename... Values> void call(int (*hook)(Types...), Values... arguments)
  {
    if (!hook) return;
    bridge.array = nullptr;    // it may change
    strcpy(bridge.message, "interrupted");
    const int outcome = hook(arguments...);
    failures.rethrow();
    if (outcome == FAILED_ALIKE) failures.refuse(bridge.message);
    if (outcome != DONE) failures.end_run(bridge.message);
  }

  template <typename Number, typename... Types, typename... Values> Number query(int (*hook)(Types...), Values... arguments)
  {
    Number value = 0;
    call(hook, arguments..., &value);
    return value;
  }

  // Call a function that computes the virial, with memory for that of each atom if LAMMPS needs it.

  template <typename Function> void with_virial(Function function)
  {
    make_virial_per_atom();
    function();
    give_virial_per_atom();
  }

  void make_virial_per_atom()
  {
    if (!bridge.arrays) return;
    of_atoms.assign(vflag_atom || cvflag_atom ? 9 * atom->nlocal : 0, 0.0);
    bridge.arrays->virial.point(virial, 6);
    bridge.arrays->atom_virial.point(of_atoms.data(), of_atoms.size() / 9, 9);
  }

  // Copy the virial of each atom to the arrays of compute stress/atom and centroid/stress/atom. Atoms may have come since v_init.

  void give_virial_per_atom()
  {
    auto give = [this, n = (int) of_atoms.size() / 9](int asked, double **&array, int &rows, int columns) {
      if (asked && n > rows) memory->grow(array, rows = atom->nmax, columns, "fix:vatom");
      for (int i = 0; asked && i < n; i++) std::copy_n(&of_atoms[9 * i], columns, array[i]);
    };
    give(vflag_atom, vatom, maxvatom, 6);
    give(cvflag_atom, cvatom, maxcvatom, 9);
  }

  // A plain function, of the type of its field in Bridge, that calls a method of the fix, or of a part of it.

  template <typename Result, typename... Arguments> using Function = Result (*)(void *fix, Arguments... arguments);

  template <auto method, auto... part> struct Lend {
    template <typename Result, typename... Arguments> operator Function<Result, Arguments...>() const
    {
      return [](void *fix, Arguments... arguments) -> Result {
        auto &self = *static_cast<FixNosquish *>(fix);
        auto &owner = (self .* ... .* part);
        return self.failures.guarded([&] { return static_cast<Result>((owner.*method)(arguments...)); });
      };
    }
  };
};

}    // namespace nosquish
}    // namespace

#endif
