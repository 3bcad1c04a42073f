/* Fixes nosquish/nve, /nvt, ..., rigid/nosquish, rigid/nve/nosquish, ..., and fix python/move, as a LAMMPS plugin.

   Fix python/move is a superset of LAMMPS's own, which it replaces where LAMMPS was built with its package PYTHON. The fix line names a Python class,

       fix ID group python/move "module.class"

   and the fix calls the methods of one instance of it. The class of another style is in fix_nosquish.INTEGRATORS; those of rigid/...,
   by which LAMMPS's suffix nosquish replaces its own rigid fixes, are in host/rigid_fixes.py. Everything that is Python's is in bridge.py;
   the two sides share the plain C struct Bridge. From Python itself a few functions are called, looked
   up by name at run time, so that one compiled plugin serves every Python version. */

#include "bridge.h"
#include "external.h"
#include "lammps_versions.h"
#include "layout.h"
#include "particles.h"
#include "templates.h"

#include "angle.h"
#include "atom.h"
#include "bond.h"
#include "citeme.h"
#include "comm.h"
#include "compute.h"
#include "dihedral.h"
#include "domain.h"
#include "error.h"
#include "exceptions.h"
#include "fix.h"
#include "force.h"
#include "group.h"
#include "improper.h"
#include "input.h"
#include "kspace.h"
#include "library.h"
#include "memory.h"
#include "modify.h"
#include "neighbor.h"
#include "output.h"
#include "pair.h"
#include "timer.h"
#include "universe.h"
#include "update.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <exception>
#include <sstream>
#include <string>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>
#ifdef __linux__
#include <csignal>
#include <sys/prctl.h>
#endif

using namespace LAMMPS_NS;
using namespace FixConst;

namespace {

// ----------------------------------------------------------------------
// the interpreter
// ----------------------------------------------------------------------

template <typename Function> Function *symbol(const char *name)
{
  return reinterpret_cast<Function *>(dlsym(RTLD_DEFAULT, name));
}

// The lmp command that started this native lmp only waits for it, and leaves it behind if a signal ends
// the command alone. Linux can tell the child of its parent's end. Another parent may end as it likes.

void end_with_command()
{
#ifdef __linux__
  const char *command = getenv("FIX_NOSQUISH_COMMAND");
  if (command && std::to_string(getppid()) == command) prctl(PR_SET_PDEATHSIG, SIGTERM);
#endif
}

// The Python that has this package, as the environment names it: EXECUTABLE:LIBRARY:VERSION.

struct Interpreter {
  std::string executable, libpython, version;

  Interpreter()
  {
    const char *setting = getenv("FIX_NOSQUISH_PYTHON");
    std::istringstream words(setting ? setting : "");
    for (auto part : {&executable, &libpython, &version}) std::getline(words, *part, ':');
  }

  // what is wrong with the Python that is in this process already, or nothing
  std::string unlike() const
  {
    const auto there = version_here();
    if (version.empty() || there == version) return "";
    return "this LAMMPS has Python " + there + " inside, and " + executable + " is Python " + version +
        ": install fix_nosquish for a Python " + there;
  }

  void name_program() const    // finds the packages of its venv
  {
    const auto decode = symbol<wchar_t *(const char *, size_t *)>("Py_DecodeLocale");
    symbol<void(const wchar_t *)>("Py_SetProgramName")(decode(executable.c_str(), nullptr));
  }

 private:
  static std::string version_here()
  {
    const std::string full = symbol<const char *()>("Py_GetVersion")();
    return full.substr(0, full.find('.', full.find('.') + 1));
  }
};

bool python_runs()
{
  auto is_initialized = symbol<int()>("Py_IsInitialized");
  return is_initialized && is_initialized();
}

bool python_waits()    // LAMMPS was built with its package PYTHON
{
  return symbol<int()>("Py_IsInitialized") && !python_runs();
}

// LAMMPS's command python may be the first that needs Python: it shall have the packages of the same venv.

void name_python_early()
{
  const Interpreter python;
  if (python_waits() && !python.executable.empty() && python.unlike().empty()) python.name_program();
}

// Make sure that Python runs in this process; return what prevents it, or nothing. In a native lmp
// nothing of Python is there, or what LAMMPS's package PYTHON brings: the lmp command, which is a Python
// script, leaves the path of its interpreter and of that interpreter's shared library in the environment.

std::string start_python()
{
  if (python_runs()) return "";

  const Interpreter python;
  if (python.executable.empty())
    return "no Python in this process: start LAMMPS by the command lmp that stands beside the python "
           "for which fix_nosquish is installed, or by: python -m fix_nosquish -in FILE. A LAMMPS of "
           "your own needs first: eval \"$(python -m fix_nosquish.plugin)\"";
  const std::string instead = ": use instead python -m fix_nosquish -in FILE";

  end_with_command();
  if (!python_waits()) {
    if (python.libpython.empty())
      return "the Python " + python.executable + " has no shared libpython" + instead;
    if (!dlopen(python.libpython.c_str(), RTLD_NOW | RTLD_GLOBAL)) return dlerror() + instead;
  }
  auto initialize = symbol<void(int)>("Py_InitializeEx");
  auto run = symbol<int(const char *)>("PyRun_SimpleString");
  if (!initialize || !run || !symbol<void>("Py_SetProgramName"))
    return "cannot start Python from " + python.libpython + instead;
  const auto unlike = python.unlike();
  if (!unlike.empty()) return unlike;

  python.name_program();
  // This thread keeps Python's lock: a LAMMPS with the package PYTHON ends Python as one that has it.
  initialize(0);
  // Ctrl-C ends LAMMPS at once, as it does without Python: module signal would change that when a class
  // imports it
  run("import signal as s\n"
      "if s.getsignal(s.SIGINT) is s.default_int_handler: s.signal(s.SIGINT, s.SIG_DFL)\n"
      "del s");
  // where nothing ends this interpreter, nothing may wait in its buffers
  run("__import__('sys').stdout.reconfigure(line_buffering=True)");
  return "";
}

// Run a line of Python, whichever thread this is.

void run_python(const std::string &line)
{
  auto state = symbol<int()>("PyGILState_Ensure")();
  symbol<int(const char *)>("PyRun_SimpleString")(line.c_str());
  symbol<void(int)>("PyGILState_Release")(state);
}

// ----------------------------------------------------------------------
// the fix
// ----------------------------------------------------------------------

const std::string PYTHON_MOVE = "python/move";
const std::string NATIVE[] = {"nosquish/nve", "nosquish/nvt", "nosquish/npt", "nosquish/nph", "nosquish/hmc", "nosquish/fire"};

// With the suffix LAMMPS takes these in the place of its own, and their computes: see computes.h.

const std::string SUFFIX = "/nosquish";
const std::string REPLACED[] = {"rigid",           "rigid/nve",       "rigid/nvt",       "rigid/npt",       "rigid/nph",
                                "rigid/small",     "rigid/nve/small", "rigid/nvt/small", "rigid/npt/small", "rigid/nph/small"};

bool replaces(const std::string &style)
{
  return style.rfind("rigid", 0) == 0;
}

// Styles under which a fix of this plugin may have left its state.

bool may_be_ours(const std::string &style)
{
  return style == PYTHON_MOVE || replaces(style) || std::count(std::begin(NATIVE), std::end(NATIVE), style);
}

const std::string COMPUTES[] = {"rigid/local", "ke/rigid", "erotate/rigid"};

const char PAPER[] = "fix nosquish: https://doi.org/10.1063/1.1473654\n\n"
                     "@Article{Miller2002,\n"
                     " author = {Miller, T. F. and Eleftheriou, M. and Pattnaik, P. and Ndirango, A. and Newns, D. and Martyna, G. J.},\n"
                     " title = {Symplectic quaternion scheme for biophysical molecular dynamics},\n"
                     " journal = {J. Chem. Phys.},\n"
                     " volume = 116,\n"
                     " pages = {8649--8659},\n"
                     " year = 2002\n"
                     "}\n\n";

// What a fix of this plugin writes to a restart file begins with this. LAMMPS's own rigid fixes may be given it, because a suffix
// is not part of the style's name there: of two zeros they take nothing.

struct State {
  double nothing[2] = {0.0, 0.0}, ours = 4.929e-49, rotor = -1.0, size = 0.0;    // of the numbers behind it

  static bool is_in(const char *buffer)
  {
    State found;
    memcpy(found.nothing, buffer, sizeof found.nothing);    // the state of another fix may end here
    if (found.nothing[0] != 0.0 || found.nothing[1] != 0.0) return false;
    memcpy(&found, buffer, sizeof found);
    return found.ours == State().ours;
  }

  static State of(const char *buffer)
  {
    State found;
    memcpy(&found, buffer, sizeof found);
    return found;
  }
};

// What to say of a class that LAMMPS has otherwise than the headers.

std::string another_class(const std::string &name)
{
  return "this LAMMPS has another class " + name +
      " than the headers with which fix_nosquish's plugin was compiled, although the version is the same: it was built with other "
      "options or patches. Compile the plugin again, in a checkout of fix_nosquish: pip install --force-reinstall --no-deps . "
      "with NOSQUISH_LAMMPS set to the source tree or the install folder of this LAMMPS (see docs/own-lammps.md)";
}

// Whether a fix holds atoms together by forces.

bool holds(const Fix *fix)
{
  return utils::strmatch(fix->style, "^shake") || utils::strmatch(fix->style, "^rattle");
}
// Another value in some place, until the block ends, also where LAMMPS throws.

template <typename T> class InPlace {
 public:
  InPlace(T &place, T value) : place(place), former(place) { place = value; }
  ~InPlace() { place = former; }
  InPlace(const InPlace &) = delete;

 private:
  T &place;
  const T former;
};

class FixPythonMove : public Fix {
 public:
  FixPythonMove(LAMMPS *, int, char **);
  ~FixPythonMove() override;
  int setmask() override;
  int modify_param(int, char **) override;
  void init() override;
  void setup(int) override;
  void min_setup(int) override;
  void setup_post_neighbor() override { post_neighbor(); }
  void post_neighbor() override;
  void setup_pre_reverse(int eflag, int vflag) override { pre_reverse(eflag, vflag); }
  void pre_reverse(int, int) override;
  void pre_exchange() override;
  void post_force(int) override;
  void initial_integrate(int) override;
  void final_integrate() override;
  void initial_integrate_respa(int, int, int) override;
  void final_integrate_respa(int, int) override;
  void end_of_step() override;
  void post_run() override;
  void write_restart_file(const char *) override;
  void write_restart(FILE *) override;
  void restart(char *) override;
  void reset_dt() override;
  void deform(int) override;
  bigint dof(int) override;
  void zero_momentum() override { call(bridge.zero_momentum); }
  void zero_rotation() override { call(bridge.zero_rotation); }
  void reset_target(double temperature) override { call(bridge.reset_target, temperature); }
  bool has_bodies() const { return bridge.rows_of_rank; }
  double kinetic_energy(int which);
  int rows_of_rank(const char *words, int group, double *&values);
  double compute_scalar() override;
  double compute_vector(int) override;
  double compute_array(int, int) override;
  void *extract(const char *, int &) override;
  void grow_arrays(int) override;
  void copy_arrays(int i, int j, int) override { origin[j] = origin[i]; }
  void set_arrays(int i) override { origin[i] = -1; }
  void set_molecule(int, tagint, int, double *, double *, double *) override;
  int pack_exchange(int, double *) override;
  int unpack_exchange(int, double *) override;
  int pack_reverse_comm(int, int, double *) override;
  void unpack_reverse_comm(int, int *, double *) override;
  int pack_forward_comm(int, int *, double *, int, int *) override;
  void unpack_forward_comm(int, int, double *) override;
  double memory_usage() override;

 private:
  Bridge bridge;
  MPI_Comm failing;    // for ranks whose Python failed
  bool respa = false, stopped = false;
  bool early = false;    // bodies have the forces of the fixes before this one
  std::vector<double> early_force, early_torque;
  std::vector<int> extensive;
  std::vector<double> kept_box;
  double first_volume = 0.0;    // of the run; 0 when its change has been told
  // of each atom: rank << 32 | place when it was noted, -1 if it was not, -2 - row if it came with that row of what has
  // arrived
  int64_t *origin = nullptr;
  std::vector<double> arrived;
  double forces_virial[6] = {}, told_box[9] = {};
  std::vector<double> of_atoms;    // the virial of each, nine numbers
  std::vector<double> counted;    // forces on local and ghost atoms
  std::vector<double> clusters;    // of each atom: from the centre of its cluster, and the velocity of that, six numbers
  double kept_rate[6] = {};    // how fast fix deform's box vectors change, as a run begins
  static constexpr int INSERTED = 10;
  std::vector<double> inserted;    // molecules, so many numbers of each
  std::vector<double> external;    // values of the words of fix_modify external
  std::vector<int> sizes;
  double told[7] = {};
  std::array<int64_t, 3> array_when;    // bridge.array is of then
  Particles particles;
  std::exception_ptr kept;    // what LAMMPS has thrown below loops
  std::string command;
  std::string virial_id;    // of a compute pressure, for which LAMMPS's forces tally their virial
  std::string energy_id;    // of a compute pe, for which they tally their energy

  static FixPythonMove *self(void *fix) { return static_cast<FixPythonMove *>(fix); }
  void look_at_accelerators() const;
  void fill_bridge(), add_computes(), set_flags(), let_go();
  const char *last_command();
  int describe(int, FixFacts *) const;
  int64_t removed_freedom(const char *, const char *) const;
  void point();
  void set_cell(int, const void *, int64_t, int64_t);
  Molecule **first_molecule() const;
  void make_virial_per_atom(), give_virial_per_atom();
  std::vector<double> box() const;
  void tell_box();
  double volume() const;
  void look_at_volume();
  void stream_with_box();
  int64_t run(const Pass *);
  int64_t now() const;
  bool is(When bit) const { return now() >> bit & 1; }
  bool follow(const Action *);
  int64_t set_box(const double *);
  int64_t flip_box(const double *);
  int64_t find_clusters();
  tagint find_cluster(int, Fix *, double *);
  int64_t stop();
  void shift_lamda(int, double, double);
  void take_virial();
  void ask_for_pressure(bigint step);
  int asked_by_others(int vflag) const;
  double potential();
  Compute *own_compute(const std::string &own) const;
  void ask_for_energy(bigint step) { own_compute(energy_id)->addstep(step); }
  void go_back();
  void renew_forces();
  int modify_external(int, char **);
  void push();
  std::string problem(const std::string &text) const;
  void keep_state() { restart_global = bridge.restart_size > 0 || bridge.rotor >= 0; }    // in restart files
  void take_over_state(), refuse_casts() const, refuse_stale_forces() const;
  [[noreturn]] void end_run(const std::string &text, double patience = 2.0);
  [[noreturn]] void abort_all() const;
  template <typename Function> int64_t kept_from_loops(Function function);
  void throw_kept();
  void flush_log() const;
  void log(const std::string &text) const;
  template <typename... Types, typename... Values>
  void call(int (*hook)(Types...), Values... arguments);
  template <typename Function> void with_virial(Function function);
};

FixPythonMove::FixPythonMove(LAMMPS *lmp, int narg, char **arg) :
    Fix(lmp, narg, arg), bridge(), failing(MPI_COMM_NULL)
{
  const bool quoted = PYTHON_MOVE == arg[2];
  if (quoted && narg < 4) utils::missing_cmd_args(FLERR, "fix python/move", error);
  if (quoted && narg > 4)
    error->all(FLERR, problem("put the class and its words in quotes: \"" + std::string(arg[3]) +
                              " " + arg[4] + " ...\""));

  look_at_accelerators();
  time_integrate = 1;
  dynamic_group_allow = 1;
  dynamic = 1;    // see init()

  if (universe->nprocs > 1) MPI_Comm_dup(world, &failing);

  const auto obstacle = start_python();
  if (!obstacle.empty()) end_run(obstacle);    // other ranks may have a Python, and wait in it

  fill_bridge();
  std::string line = arg[2];
  for (int k = 3; k < narg; k++) line += std::string("\n") + arg[k];
  bridge.line = line.c_str();
  const auto address = std::to_string(reinterpret_cast<uintptr_t>(&bridge));
  run_python("__import__('fix_nosquish.plugin.bridge', fromlist=['attach']).attach(" + address + ")");
  bridge.line = nullptr;
  if (bridge.outcome != DONE) end_run(bridge.message, 5.0);    // imports may take their time

  if (lmp->citeme && (!quoted || std::string(arg[3]).rfind("fix_nosquish.", 0) == 0)) lmp->citeme->add(PAPER);
  try {
    add_computes();
    set_flags();
    if (bridge.follows_atoms) {
      create_attribute = 1;
      maxexchange = std::max(1, bridge.carries);
      grow_arrays(atom->nmax);
      std::fill_n(origin, atom->nlocal, -1);
      atom->add_callback(Atom::GROW);
    }
  } catch (...) {    // no destructor will be called
    let_go();
    throw;
  }
  take_over_state();
}

// LAMMPS sets the name of a style with the suffix behind the constructor.

std::string FixPythonMove::problem(const std::string &text) const
{
  std::string name = style;
  if (replaces(name) && name.find(SUFFIX) == std::string::npos) name += SUFFIX;
  return "Fix " + std::string(id) + " " + name + ": " + text;
}

// LAMMPS gives a fix the state in a restart file that one of its own ID and style has left; one of another style of ours may
// have done so.

void FixPythonMove::take_over_state()
{
  char *state = RestartState::left_by(modify, id, [this](const std::string &other, const char *state) {
    return may_be_ours(other) && other != style && State::is_in(state) && (restart_global || State::of(state).rotor >= 0);
  });
  if (!state) return;
  restart(state);
  if (comm->me == 0) utils::logmesg(lmp, problem("it goes on from the state of its ID in the restart file\n"));
}

// What Python may ask of this fix, and where LAMMPS keeps what Python reads.

void FixPythonMove::fill_bridge()
{
  bridge.checksum = BRIDGE_CHECKSUM;
  bridge.fix = this;
  bridge.lammps = lmp;
  bridge.fix_id = id;
  bridge.group = group->names[igroup];
  bridge.virial = virial;
  bridge.log = [](void *fix, const char *text) { self(fix)->log(text); };
  bridge.nth_fix = [](void *fix, int n, void *facts) {
    return self(fix)->describe(n, static_cast<FixFacts *>(facts));
  };
  bridge.ghost_velocity = [](void *fix) { return self(fix)->comm->ghost_velocity; };
  bridge.scalar_pressure = [](void *fix) {
    const auto kspace = self(fix)->force->kspace;
    return (int) (kspace && kspace->scalar_pressure_flag);
  };
  bridge.command = [](void *fix) { return self(fix)->last_command(); };
  bridge.removed_freedom = [](void *fix, const char *other, const char *group) {
    return self(fix)->removed_freedom(other, group);
  };
  bridge.varies = [](void *fix, const char *other) {
    Fix *found = self(fix)->modify->get_fix_by_id(other);
    return (int) (found && found->memory_usage() > 0.0);
  };
  bridge.begin_step_of = [](void *fix, const char *other) {
    if (Fix *found = self(fix)->modify->get_fix_by_id(other)) found->initial_integrate(0);
  };
  bridge.pair_style = [](void *fix, const char *first) {
    return (int) (self(fix)->force->pair_match(std::string("^") + first, 0, 1) != nullptr);
  };
  bridge.set_array_rows = [](void *fix, int n) { self(fix)->size_array_rows = n; };
  bridge.keep = [](void *fix) { self(fix)->kept_box = self(fix)->box(); };
  bridge.point = [](void *fix) { self(fix)->point(); };
  bridge.now = [](void *fix) { return self(fix)->now(); };
  bridge.potential = [](void *fix) {
    double energy = 0.0;
    self(fix)->kept_from_loops([&] { return energy = self(fix)->potential(), (int64_t) 0; });
    return energy;
  };
  bridge.ask_for_energy = [](void *fix, int64_t step) {
    self(fix)->kept_from_loops([&] { return self(fix)->ask_for_energy(step), (int64_t) 0; });
  };
  bridge.go_back = [](void *fix) {
    self(fix)->kept_from_loops([&] { return self(fix)->go_back(), (int64_t) 0; });
    return (int) (self(fix)->kept != nullptr);
  };
  bridge.set_box = [](void *fix, const double *box) {
    return self(fix)->kept_from_loops([fix, box] {
      if (self(fix)->bridge.held) self(fix)->find_clusters();    // ghost atoms are images by the box as it was
      self(fix)->set_box(box);
      self(fix)->look_at_volume();
      return (int64_t) 0;
    });
  };
  bridge.flip_box = [](void *fix, const double *box) {
    return self(fix)->kept_from_loops([fix, box] { return self(fix)->flip_box(box); });
  };
  bridge.particles = [](void *fix, double *numbers) {
    auto &particles = self(fix)->particles;
    particles.find(self(fix)->atom);
    return (int) particles.read(self(fix)->atom, numbers);
  };
  bridge.orient = [](void *fix, int64_t i, const double *quat) {
    self(fix)->particles.orient(self(fix)->atom, (int) i, quat);
    return (int64_t) 0;
  };
  bridge.inserted = [](void *fix, double *numbers) {
    auto &inserted = self(fix)->inserted;
    const int count = inserted.size() / INSERTED;
    if (numbers) {
      std::copy(inserted.begin(), inserted.end(), numbers);
      inserted.clear();
    }
    return count;
  };
  bridge.molecule = [](void *fix, int number, double *numbers) {
    const auto first = self(fix)->first_molecule();
    return (int) (first && Templates::read(self(fix)->atom, first[number], numbers));
  };
  bridge.find_clusters = [](void *fix) {
    return self(fix)->kept_from_loops([fix] { return self(fix)->find_clusters(); });
  };
  bridge.stop = [](void *fix) { return self(fix)->stop(); };
  bridge.gravity = [](void *fix, const char *other) {
    int dimension;
    Modify &all = *self(fix)->modify;
    const int at = all.find_fix(other);    // behind this fix it does not know its variables' values when this one begins
    const bool before = at >= 0 && at < all.find_fix(self(fix)->id);
    return reinterpret_cast<int64_t>(before ? all.fix[at]->extract("gvec", dimension) : nullptr);
  };
  bridge.rate = domain->h_rate;
  bridge.forces_virial = forces_virial;
  bridge.told_box = told_box;
  bridge.told = told;
  bridge.natoms = -1;
  bridge.next_output = &output->next;
  bridge.begin_step = &update->beginstep;
  bridge.end_step = &update->endstep;
  bridge.last_step = &update->laststep;
  bridge.begins = bridge.energy_step = -1;
  bridge.argument = bridge.rotor = -1;
  strcpy(bridge.message, "cannot import fix_nosquish.plugin.bridge");
}

// Computes of this fix's own, for which LAMMPS's forces tally what the integrator needs.

void FixPythonMove::add_computes()
{
  auto add = [this](std::string &own, const std::string &what, const std::string &words) {
    const std::string name = std::string(id) + what;
    modify->add_compute(name + words);
    own = name;    // a script's own of this name stays
  };
  if (bridge.changes_box) add(virial_id, "_virial", " all pressure NULL virial");
  if (bridge.needs_energy) add(energy_id, "_energy", " all pe");
}

// What LAMMPS is to know of the integrator, as it declares it.

void FixPythonMove::set_flags()
{
  if (bridge.dof) dof_flag = 1;
  if (bridge.wants_virial) virial_global_flag = thermo_virial = 1;
  if (bridge.wants_virial_per_atom) virial_peratom_flag = thermo_virial = 1;
  centroidstressflag = CENTROID_AVAIL;    // not symmetric: no force of an atom is along its arm
  restart_file = bridge.writes_restart_file;
  keep_state();
  ecouple_flag = bridge.couples;
  if (bridge.changes_box) {
    comm_forward = comm_reverse = 3;
    box_change |= BOX_CHANGE_SIZE | (domain->triclinic ? BOX_CHANGE_SHAPE : 0);
    no_change_box = 1;
    pre_exchange_migrate = bridge.flips;
  }
  rigid_flag = bridge.rigid || bridge.follows_atoms;    // so that fix deform calls deform()

  scalar_flag = bridge.compute_scalar != nullptr;
  extscalar = bridge.couples;
  extarray = 0;
  if (bridge.vector_size > 0) {
    extensive.assign(bridge.vector_extensive, bridge.vector_extensive + bridge.vector_size);
    vector_flag = 1;
    size_vector = bridge.vector_size;
    extvector = -1;
    extlist = extensive.data();
  }
  if (bridge.array_columns > 0) {
    array_flag = 1;
    size_array_cols = bridge.array_columns;
    size_array_rows = std::max(0, bridge.array_rows);
    size_array_rows_variable = bridge.array_rows < 0;    // fix ave/time accepts no variable number
  }
  global_freq = 1;
}

// Forces on a graphics card: LAMMPS would bring them for this fix, but nobody has tried. KOKKOS for the host's own cores has
// the same memory as LAMMPS.

void FixPythonMove::look_at_accelerators() const
{
  bool card = !modify->get_fix_by_style("^GPU$").empty();
  for (const char *api : {"cuda", "hip", "sycl"})
    card |= lmp->kokkos && lammps_config_accelerator("KOKKOS", "api", api);
  if (card)
    error->all(FLERR, problem("forces on a graphics card were never tried with this fix: start LAMMPS without -sf gpu, "
                              "package gpu, or -k on with a card"));
  if (lmp->kokkos && comm->me == 0)
    utils::logmesg(lmp, problem("KOKKOS runs on the host here. Forces are where this fix needs them, and nothing is copied\n"));
}

FixPythonMove::~FixPythonMove()
{
  if (bridge.follows_atoms && modify->get_fix_by_id(id)) atom->delete_callback(id, Atom::GROW);
  if (stopped) timer->reset_timeout();
  let_go();
}

// Give back what LAMMPS, MPI and Python keep for this fix.

void FixPythonMove::let_go()
{
  memory->destroy(origin);
  if (bridge.words && modify->nfix) ExternalForces::replace(modify, std::string(id) + "_external", false, false);
  for (const auto &own : {virial_id, energy_id})
    if (!own.empty() && modify->get_compute_by_id(own)) modify->delete_compute(own);
  if (bridge.release) bridge.release(&bridge);
  int finalized;
  MPI_Finalized(&finalized);
  if (failing != MPI_COMM_NULL && !finalized) MPI_Comm_free(&failing);
}

// A compute that this fix has added; a script can take it away.

Compute *FixPythonMove::own_compute(const std::string &own) const
{
  Compute *found = modify->get_compute_by_id(own);
  if (!found) error->all(FLERR, problem("compute " + own + " is gone, which this fix has added and needs: leave out the uncompute"));
  return found;
}

int FixPythonMove::setmask()
{
  return INITIAL_INTEGRATE | FINAL_INTEGRATE | INITIAL_INTEGRATE_RESPA | FINAL_INTEGRATE_RESPA |
      (bridge.flips ? PRE_EXCHANGE : 0) | (bridge.changes_box ? PRE_REVERSE : 0) | (bridge.post_neighbor ? POST_NEIGHBOR : 0) | (bridge.end_of_step ? END_OF_STEP : 0) |
      (bridge.post_run ? POST_RUN : 0);
}

// bodyforces: rigid bodies have the forces of all fixes (late), or of those before this one (early). temp and press: what
// LAMMPS's barostats take from these computes, a class that changes the box finds by itself.

int FixPythonMove::modify_param(int narg, char **arg)
{
  if (strcmp(arg[0], "external") == 0 && bridge.modify_external) return modify_external(narg, arg);
  if (!bridge.follows_atoms || narg < 2) return 0;
  const std::string word = arg[0], value = arg[1];
  if (word == "temp" || word == "press") {
    if (!bridge.changes_box) return 0;
    if (comm->me == 0)
      error->warning(FLERR, problem("fix_modify " + word + " " + value + " has no effect: temperature and pressure are those of what "
                                    "this fix moves, and of the atoms that its box takes along"));
    return 2;
  }
  if (word != "bodyforces") return 0;
  if (value != "early" && value != "late") error->all(FLERR, problem("bodyforces " + value + ": expected early or late"));
  early = value == "early";
  int &mask = modify->fmask[modify->find_fix(id)];
  mask = early ? mask | POST_FORCE : mask & ~POST_FORCE;
  return 2;
}

// external: forces and torques on the bodies, as Python reads the words; they go to the end of the command.

int FixPythonMove::modify_external(int narg, char **arg)
{
  const std::string telling = std::string(id) + "_external";
  Fix *there = modify->get_fix_by_id(telling);
  if (there && !dynamic_cast<ExternalForces *>(there))
    error->all(FLERR, problem("fix " + telling + " (style " + there->style + ") has the ID of the fix that tells of external forces: "
                              "give it another ID"));
  char **all = arg;
  const int n = utils::expand_args(FLERR, narg, arg, 1, all, lmp);    // f_ID[*]
  std::string words;
  for (int k = 1; k < n; k++) words += std::string(all[k]) + " ";
  if (all != arg) {
    for (int k = 0; k < n; k++) delete[] all[k];
    memory->sfree(all);
  }
  call(bridge.modify_external, words.c_str());
  ExternalForces::replace(modify, telling, bridge.tells_energy, bridge.tells_virial);
  return narg;
}

// The forces of this step are known: what acts on the bodies besides?

void FixPythonMove::push()
{
  if (!bridge.pushes) return;
  std::istringstream words(bridge.words ? bridge.words : "");
  external.clear();
  sizes.clear();
  modify->clearstep_compute();
  for (std::string word; words >> word;) sizes.push_back(values_of(word, std::string(id) + "_external", *input->variable, error, external));
  forget_vectors(*input->variable);    // they may have velocities between the halves of a step
  modify->addstep_compute(update->ntimestep + 1);
  bridge.values = external.data();
  bridge.sizes = sizes.data();
  call(bridge.push);
  if (bridge.tells_energy || bridge.tells_virial) {
    const auto telling = dynamic_cast<ExternalForces *>(modify->get_fix_by_id(std::string(id) + "_external"));
    if (!telling) error->all(FLERR, problem("fix " + std::string(id) + "_external is gone, which tells of external forces: leave out the unfix"));
    telling->take(told);
  }
}

void FixPythonMove::init()
{
  stopped = false;
  respa = utils::strmatch(update->integrate_style, "^respa");
  if (respa && !(bridge.initial_integrate_respa && bridge.final_integrate_respa))
    error->all(FLERR, problem("its class has no methods for run_style respa"));
  if (respa && early) error->all(FLERR, problem("bodyforces early is not for run_style respa: use run_style verlet"));
  if (replaces(style)) refuse_casts();
  if (update->whichflag == 2) call(bridge.min_setup, 0);    // before pair styles that look bodies up
  bridge.stream_group = domain->deform_vremap ? domain->deform_groupbit : 0;
  if (bridge.stream_group) {
    for (const auto &other : modify->get_fix_by_style("^deform")) other->init();    // it finds its rates, perhaps behind this fix
    std::copy_n(domain->h_rate, 6, kept_rate);
  }
  for (const auto &other : modify->get_fix_by_style("^efield")) other->init();    // it looks its variables up: see `varies`
  call(bridge.init);
  keep_state();
  refuse_stale_forces();
  if (!dynamic && bridge.follows_atoms && comm->me == 0)
    error->warning(FLERR, problem("fix_modify dynamic/dof no has no effect: degrees of freedom are always those of the bodies there are"));
  dynamic = 1;
  first_volume = volume();
  if (bridge.changes_box) ask_for_pressure(update->ntimestep);
  if (bridge.needs_energy) ask_for_energy(update->ntimestep);
}

// LAMMPS leaves the forces on atoms outside the group of neigh_modify include as they are in memory.

void FixPythonMove::refuse_stale_forces() const
{
  const int bit = neighbor->includegroup ? group->bitmask[neighbor->includegroup] : 0;
  tagint own = 0, atom_left = 0;
  for (int i = 0; i < atom->nlocal && bit && origin; i++)
    if (origin[i] != -1 && !(atom->mask[i] & bit)) own = atom->tag[i];
  if (bit) MPI_Allreduce(&own, &atom_left, 1, MPI_LMP_TAGINT, MPI_MAX, world);
  if (atom_left)
    error->all(FLERR, problem("neigh_modify include leaves out atom " + std::to_string(atom_left) + ", which this fix moves, and LAMMPS "
                              "computes no forces on such atoms: have all bodies and points in that group (and in that of atom_modify "
                              "first), or leave it out"));
}

// What begins with rigid LAMMPS takes for its own class in places, without a look.

void FixPythonMove::refuse_casts() const
{
  for (const auto &other : modify->get_compute_list())
    for (const auto &name : COMPUTES)
      if (name == other->style)
        error->all(FLERR, problem("compute " + std::string(other->id) + " (style " + name + ") is LAMMPS's own, which takes each fix "
                                  "rigid for its own: define it with the suffix on, or write " + name + SUFFIX));
}

void FixPythonMove::setup(int vflag)
{
  v_init(vflag);
  push();
  take_virial();
  if (early) post_force(vflag);
  bridge.vflag = vflag;
  with_virial([&] {
    if (!follow(bridge.at_setup)) call(bridge.setup, vflag);
  });
}

void FixPythonMove::min_setup(int vflag)
{
  call(bridge.min_setup, vflag);
}

void FixPythonMove::post_neighbor()
{
  point();
  if (bridge.at_flipped && box() != kept_box) {    // by fix deform
    tell_box();
    follow(bridge.at_flipped);
    kept_box = box();
  }
  const int64_t other = (int64_t) 1 << OTHER_BOX;
  bridge.facts = box() == kept_box ? bridge.facts & ~other : bridge.facts | other;
  if (!follow(bridge.at_neighbor)) call(bridge.post_neighbor);
  keep_state();
}

// Keep the forces of now for the bodies: fixes behind this one add theirs to LAMMPS's own arrays.

void FixPythonMove::post_force(int)
{
  auto keep = [this](int cell, std::vector<double> &kept, double **array) {
    if (!array || !atom->nlocal) return;
    kept.assign(array[0], array[0] + 3 * atom->nlocal);
    set_cell(cell, kept.data(), atom->nlocal, 3);
  };
  keep(F, early_force, atom->f);
  keep(TORQUE, early_torque, atom->torque);
}

// Keep the forces that LAMMPS's virial counts, before fixes add theirs: those of pairs, bonds and mesh.

void FixPythonMove::pre_reverse(int, int)
{
  if (!bridge.counts || !is(PRESSURE)) return;
  const int local = atom->nlocal, all = local + atom->nghost;
  counted.assign(3 * (size_t) all, 0.0);
  for (int i = 0; i < (force->newton ? all : local); i++) std::copy_n(atom->f[i], 3, &counted[3 * (size_t) i]);
  if (force->newton) comm->reverse_comm(this);
  set_cell(COUNTED, counted.data(), local, 3);
}

int FixPythonMove::pack_reverse_comm(int n, int first, double *buffer)
{
  std::copy_n(&counted[3 * (size_t) first], 3 * n, buffer);
  return 3 * n;
}

void FixPythonMove::unpack_reverse_comm(int n, int *list, double *buffer)
{
  for (int k = 0; k < n; k++)
    for (int c = 0; c < 3; c++) counted[3 * (size_t) list[k] + c] += *buffer++;
}

// The lists are built anew: the time for other box vectors, if these are better.

void FixPythonMove::pre_exchange()
{
  follow(bridge.at_exchange);
}

void FixPythonMove::initial_integrate(int vflag)
{
  if (!bridge.initial_integrate) end_run("the Python that holds its class has shut down");
  flush_log();
  v_init(vflag);
  stream_with_box();
  bridge.vflag = asked_by_others(vflag);
  if (!follow(bridge.at_begin)) call(bridge.initial_integrate, bridge.vflag);
}

void FixPythonMove::final_integrate()
{
  push();
  take_virial();
  if (!bridge.vflag) update->vflag_global = -1;    // whoever reads a virial nevertheless hears that there is none
  with_virial([&] {
    if (!follow(bridge.at_end)) call(bridge.final_integrate);
  });
}

// What holds in this step: bits of When.

int64_t FixPythonMove::now() const
{
  const bigint step = update->ntimestep;
  const auto falls_on = [](int every, bigint step) { return every && step % every == 0; };
  const bool moves_box = falls_on(bridge.changes_box, step - 1);
  const std::pair<When, bool> holds[] = {
      {CALLED, step == bridge.begins},
      {SHOWN, step == output->next || falls_on(bridge.velocities_every, step)},
      {VIRIAL_ASKED, bridge.vflag},
      {TABLE, falls_on(bridge.table_every, step)},
      {ENERGY, step == bridge.energy_step},
      {MOVES_BOX, moves_box},
      {PRESSURE, moves_box || falls_on(bridge.changes_box, step)},
  };
  int64_t bits = bridge.facts;
  for (const auto &[bit, so] : holds) bits |= (int64_t) so << bit;
  return bits;
}

// Do what the schedule has for a hook; returns whether it has something. run/schedule.py has the same in Python.

bool FixPythonMove::follow(const Action *action)
{
  if (!action) return false;
  const int64_t now = this->now();
  for (; action->phases; action++) {
    if (!(action->phases >> bridge.phase & 1) || action->when & ~now || action->unless & now) continue;
    const int64_t found = run(action->passes);
    if (found || (!action->passes && action->number >= 0)) call(bridge.act, action->number, found);
    if (action->then >= 0) bridge.phase = action->then;
    bridge.facts = (bridge.facts | action->sets) & ~action->clears;
  }
  return true;
}

void FixPythonMove::initial_integrate_respa(int vflag, int ilevel, int iloop)
{
  flush_log();
  if (ilevel == 0) v_init(vflag);
  call(bridge.initial_integrate_respa, vflag, ilevel, iloop);
}

void FixPythonMove::final_integrate_respa(int ilevel, int iloop)
{
  call(bridge.final_integrate_respa, ilevel, iloop);
}

// The molecules of the template are side by side.

Molecule **FixPythonMove::first_molecule() const
{
  const int number = bridge.template_id ? atom->find_molecule(bridge.template_id) : -1;
  return number < 0 ? nullptr : atom->molecules + number;
}

// Another fix has inserted a molecule of the template, with atoms of its own on each rank: all ranks are told. What its atoms do
// not say of it is kept until LAMMPS has brought them to their ranks.

void FixPythonMove::set_molecule(int before, tagint tag, int number, double *, double *velocity, double *quat)
{
  inserted.insert(inserted.end(), {(double) tag, (double) (atom->nlocal - before), (double) number});
  inserted.insert(inserted.end(), velocity, velocity + 3);
  inserted.insert(inserted.end(), quat, quat + 4);
}

// Granular pair styles look up the mass of the body of each atom here. Between runs commands ask whether what they change is in
// bodies, to warn that it has no effect: it has one here. Fixes that insert molecules see whether their template,
// a place in LAMMPS's list of these, is that of the bodies.

void *FixPythonMove::extract(const char *name, int &dim)
{
  dim = 0;
  if (strcmp(name, "onemol") == 0) return first_molecule();
  dim = 1;
  if (strcmp(name, "body") == 0) return update->whichflag ? bridge.body : nullptr;
  if (strcmp(name, "masstotal") == 0) return bridge.masstotal;
  return nullptr;
}

// Verlet ends its step in final_integrate, but fix deform changes the box behind that.

void FixPythonMove::end_of_step()
{
  stream_with_box();
  if (respa) with_virial([&] { call(bridge.end_of_step); });
  if (!stopped) return;
  const bool over = timer->is_timeout();    // another fix may have ended the run
  const auto bytes = reinterpret_cast<const char *>(timer);
  const std::vector<char> before(bytes, bytes + sizeof(Timer));
  lammps_force_timeout(lmp);    // as fix halt ends a run; not before, as a run that fails leaves it so
  const bool same = memcmp(before.data(), bytes, sizeof(Timer)) == 0;
  if (!timer->is_timeout() || same != over) error->all(FLERR, problem(another_class("Timer")));
}

void FixPythonMove::post_run()
{
  stream_with_box();
  call(bridge.post_run);
  if (stopped) timer->reset_timeout();    // else no later run would begin
  stopped = false;
}

void FixPythonMove::write_restart_file(const char *name)
{
  call(bridge.write_restart_file, name);
}

// The size in bytes, for LAMMPS, then numbers.

void FixPythonMove::write_restart(FILE *file)
{
  call(bridge.write_restart);
  if (comm->me) return;
  State begin;
  begin.rotor = bridge.rotor;
  begin.size = bridge.restart_size;
  const int bytes = sizeof begin + bridge.restart_size * sizeof(double);
  fwrite(&bytes, sizeof(int), 1, file);
  fwrite(&begin, sizeof begin, 1, file);
  fwrite(bridge.restart_state, sizeof(double), bridge.restart_size, file);
}

// The class's first number says what the others are.

void FixPythonMove::restart(char *buffer)
{
  const int size = bridge.restart_size;
  if (!State::is_in(buffer)) {
    if (size && comm->me == 0)
      error->warning(FLERR, problem("the restart file has a state for this ID that this fix did not write, as LAMMPS's own rigid "
                                    "fixes do: it is not used, and thermostat and barostat begin anew"));
    return;
  }
  const State begin = State::of(buffer);
  bridge.rotor = (int32_t) begin.rotor;
  if (!size || !begin.size) return;
  const char *numbers = buffer + sizeof begin;
  double kind = 0.0;
  memcpy(&kind, numbers, sizeof(double));
  if (begin.size == size && kind == bridge.restart_state[0]) memcpy(bridge.restart_state, numbers, size * sizeof(double));
  else bridge.restart_state[0] = -1.0;
}

void FixPythonMove::reset_dt()
{
  call(bridge.reset_dt);
}

// Another fix changes the box, and all that is in it (0 before, 1 behind). The box is then that of the class.

void FixPythonMove::deform(int behind)
{
  if (!behind || !bridge.at_deform) return;    // if it cannot follow, it finds another box than it knows
  tell_box();
  follow(bridge.at_deform);
  kept_box = box();
}

void FixPythonMove::tell_box()
{
  const auto now = box();
  std::copy(now.begin(), now.end(), told_box);
}

// With remap v fix deform changes the box alone, and does not tell.

void FixPythonMove::stream_with_box()
{
  if (!bridge.stream_group || !bridge.at_deform || box() == kept_box) return;
  if (!std::equal(kept_rate, kept_rate + 6, domain->h_rate))
    error->all(FLERR, problem("fix deform has other rates now than when the run began: with remap v bodies follow constant ones, "
                              "as of erate, vel, delta, scale or final"));
  deform(1);
}

bigint FixPythonMove::dof(int igroup)
{
  int64_t count = 0;
  call(bridge.dof, igroup, &count);
  return count;
}

double FixPythonMove::compute_scalar()
{
  double value = 0.0;
  call(bridge.compute_scalar, &value);
  return value;
}

double FixPythonMove::compute_vector(int i)
{
  if (i >= size_vector)    // thermo_style and others may have been written for another fix of this ID
    error->all(FLERR, problem("f_" + std::string(id) + "[" + std::to_string(i + 1) +
                              "] was asked for, and this fix has " + std::to_string(size_vector) +
                              " such values: thermo_style, or what else names it, was for a fix with other words. "
                              "Write it anew behind this fix"));
  double value = 0.0;
  call(bridge.compute_vector, i, &value);
  return value;
}

double FixPythonMove::compute_array(int i, int j)
{
  double value = 0.0;
  if (i >= size_array_rows) return value;    // LAMMPS asks for other rows too
  const std::array<int64_t, 3> now{update->ntimestep, bridge.phase, bridge.changes};
  if (bridge.array && now == array_when && !(bridge.facts >> LATE & 1)) return bridge.array[i * size_array_cols + j];
  call(bridge.compute_array, i, j, &value);
  array_when = {update->ntimestep, bridge.phase, bridge.changes};
  return value;
}

// The bodies' kinetic energy of translation (0) or of rotation (1), as a compute has it.

double FixPythonMove::kinetic_energy(int which)
{
  double value = 0.0;
  call(bridge.compute_vector, which, &value);
  return value;
}

// These words of the bodies that are counted on this rank: how many rows, and where they are until the next call.

int FixPythonMove::rows_of_rank(const char *words, int group, double *&values)
{
  int64_t found[2] = {};
  call(bridge.rows_of_rank, words, group, static_cast<int64_t *>(found));
  values = reinterpret_cast<double *>(found[0]);
  return (int) found[1];
}

int FixPythonMove::describe(int n, FixFacts *facts) const
{
  if (n >= modify->nfix) return 0;
  const int between = POST_INTEGRATE | PRE_EXCHANGE | PRE_NEIGHBOR | POST_NEIGHBOR | PRE_FORCE |
      PRE_REVERSE | POST_FORCE | POST_INTEGRATE_RESPA | PRE_FORCE_RESPA | POST_FORCE_RESPA;
  const int early_hooks = INITIAL_INTEGRATE | POST_INTEGRATE | INITIAL_INTEGRATE_RESPA | POST_INTEGRATE_RESPA;
  const Fix *other = modify->fix[n];
  if (!other || other == this)
    *facts = FixFacts();
  else
    *facts = {other->id, other->style, other->groupbit, other->time_integrate,
              (modify->fmask[n] & between) != 0, (modify->fmask[n] & END_OF_STEP) != 0, other->nevery,
              (modify->fmask[n] & FINAL_INTEGRATE) != 0,
              (other->box_change & ~BOX_CHANGE_DOMAIN) != 0,    // ranks' parts of the box are not the box
              modify->fmask[n] != 0, other->dof_flag && !other->time_integrate, other->energy_global_flag,
              other->energy_global_flag && other->thermo_energy, (modify->fmask[n] & POST_FORCE) != 0,
              other->virial_global_flag, other->virial_global_flag && other->thermo_virial,
              (modify->fmask[n] & early_hooks) != 0 && !other->time_integrate};
  return 1;
}

const char *FixPythonMove::last_command()
{
  const char *first = CurrentCommand::of(input);
  command = first ? first : "";
  for (int k = 0; first && k < input->narg; k++) command += std::string(" ") + input->arg[k];
  return command.c_str();
}

// What constrains atoms says so by the degrees of freedom that it removes. What moves them by itself may not be able to, so early.

int64_t FixPythonMove::removed_freedom(const char *other, const char *group_id) const
{
  Fix *fix = modify->get_fix_by_id(other);
  const int number = group->find(group_id);
  return fix && fix->dof_flag && !fix->time_integrate && number >= 0 ? fix->dof(number) : 0;
}

// Point the cells for LAMMPS's arrays at them as they are.

void FixPythonMove::point()
{
  if (!bridge.arrays) return;
  const int64_t n = atom->nlocal, width = bridge.carries;
  auto vectors = [this, n](int cell, double **array) { set_cell(cell, array && n ? array[0] : nullptr, array ? n : 0, 3); };
  auto forces = [this, n, vectors](int cell, std::vector<double> &kept, double **array) {
    if (early && array && n && (int64_t) kept.size() == 3 * n) set_cell(cell, kept.data(), n, 3);
    else vectors(cell, array);
  };
  vectors(X, atom->x);
  vectors(V, atom->v);
  forces(F, early_force, atom->f);
  forces(TORQUE, early_torque, atom->torque);
  vectors(OMEGA, atom->omega);
  set_cell(GROUPS, atom->mask, n, 0);
  set_cell(ORIGINS, origin, n, 0);
  set_cell(ARRIVED, arrived.data(), bridge.arrays[3 * ARRIVED + 1], width);
  set_cell(MASS, atom->rmass, atom->rmass ? n : 0, 0);
  set_cell(TYPE_MASS, atom->mass, atom->mass ? atom->ntypes + 1 : 0, 0);
  set_cell(TYPE, atom->type, n, 0);
  vectors(ANGMOM, atom->angmom);
  set_cell(MU, atom->mu && n ? atom->mu[0] : nullptr, atom->mu ? n : 0, 4);
  set_cell(CLUSTERS, nullptr, 0, 6);
  set_cell(COUNTED, nullptr, 0, 3);
}

void FixPythonMove::set_cell(int cell, const void *array, int64_t rows, int64_t columns)
{
  auto numbers = bridge.arrays + 3 * cell;
  numbers[0] = reinterpret_cast<int64_t>(array);
  numbers[1] = rows;
  numbers[2] = columns;
}

std::vector<double> FixPythonMove::box() const
{
  std::vector<double> numbers(domain->boxlo, domain->boxlo + 3);
  numbers.insert(numbers.end(), domain->boxhi, domain->boxhi + 3);
  numbers.insert(numbers.end(), {domain->xy, domain->xz, domain->yz});
  return numbers;
}

// The box has changed, and all atoms are where it has them.

int64_t FixPythonMove::set_box(const double *numbers)
{
  std::copy_n(numbers, 3, domain->boxlo);
  std::copy_n(numbers + 3, 3, domain->boxhi);
  if (domain->triclinic) {
    domain->xy = numbers[6];
    domain->xz = numbers[7];
    domain->yz = numbers[8];
  }
  domain->set_global_box();
  domain->set_local_box();
  if (force->kspace) force->kspace->setup();
  kept_box = box();
  return 0;
}

double FixPythonMove::volume() const
{
  const double area = domain->xprd * domain->yprd;
  return domain->dimension == 3 ? area * domain->zprd : area;
}

// A liquid or a solid changes its volume by much less than this: it boils or flies apart, or the start was far too dilute.

void FixPythonMove::look_at_volume()
{
  constexpr double much = 8.0;
  const double ratio = first_volume > 0.0 ? volume() / first_volume : 1.0;
  if (ratio < much && ratio > 1.0 / much) return;
  first_volume = 0.0;
  std::ostringstream text;
  text << "by step " << update->ntimestep << " the volume is " << ratio
       << " times that at the start of the run, " << volume() << ". If the system is to be a liquid or a solid, "
       << (ratio > 1.0 ? "it boils or flies apart: look at its energy, and use a longer PDAMP, a shorter time step or a better start"
                       : "the start was too dilute: begin another run from here, so that LAMMPS chooses mesh, ranks' parts and lists for this box")
       << '\n';
  log("WARNING: " + problem(text.str()));
}

// The box has other vectors of the same lattice: to b, c that many of a are added, and to c of b. Nothing moves in space, but
// atoms belong to other ranks, far away. So they are brought there as LAMMPS brings them, in parts of the way.

int64_t FixPythonMove::flip_box(const double *numbers)
{
  const double xy = numbers[9], xz = numbers[10], yz = numbers[11];
  domain->x2lamda(atom->nlocal);
  domain->pbc();
  comm->setup();    // fix balance may just have given the ranks other parts of the box
  comm->exchange();
  if (yz != 0.0) {
    domain->image_flip(0, 0, (int) yz);
    shift_lamda(1, 0.0, yz);
  }
  if (xy != 0.0 || xz != 0.0) {
    domain->image_flip((int) xy, (int) xz, 0);
    shift_lamda(0, xy, xz);
  }
  set_box(numbers);
  domain->lamda2x(atom->nlocal);
  return 0;
}

// Atoms that fix shake or rattle holds move with the box as one, by the centre of mass of their cluster: so its constraints
// stay, and their forces do no work. For each local atom: how far it is from that centre, and the centre's velocity. An atom
// that is not held is its own centre. Ghost atoms may be where they were before this step. Returns the ID of an atom of which
// others that are held with it stay where they are, or 0.

int64_t FixPythonMove::find_clusters()
{
  std::vector<Fix *> holding;
  for (const auto &other : modify->get_fix_list())
    if (holds(other)) holding.push_back(other);
  comm->forward_comm();
  comm->forward_comm(this);
  clusters.assign(6 * (size_t) atom->nlocal, 0.0);
  tagint cut = 0;
  for (int i = 0; i < atom->nlocal; i++) {
    double *cluster = &clusters[6 * (size_t) i];
    std::copy_n(atom->v[i], 3, cluster + 3);
    if (atom->mask[i] & bridge.held)
      for (Fix *other : holding) cut = std::max(cut, find_cluster(i, other, cluster));
  }
  set_cell(CLUSTERS, clusters.data(), atom->nlocal, 6);
  return cut;
}

// What a fix shake holds an atom with is in what it sends along with the atom: how many there are (1: three with an angle),
// and their IDs.

tagint FixPythonMove::find_cluster(int i, Fix *other, double *cluster)
{
  double sent[16], mass = 0.0;
  bool cut = false;
  other->pack_exchange(i, sent);
  const int flag = (int) sent[0], members = flag == 1 ? 3 : flag;
  if (!members) return 0;
  std::fill_n(cluster, 6, 0.0);
  for (int k = 1; k <= members; k++) {
    const int j = domain->closest_image(i, atom->map((tagint) sent[k]));
    if (j < 0) continue;    // fix shake ends the run, and says why
    cut |= !(atom->mask[j] & bridge.held);
    const double m = atom->rmass ? atom->rmass[j] : atom->mass[atom->type[j]];
    mass += m;
    for (int c = 0; c < 3; c++) {
      cluster[c] += m * (atom->x[i][c] - atom->x[j][c]);
      cluster[3 + c] += m * atom->v[j][c];
    }
  }
  for (int c = 0; c < 6; c++) cluster[c] /= mass;
  return cut ? atom->tag[i] : 0;
}

int FixPythonMove::pack_forward_comm(int n, int *list, double *buffer, int, int *)
{
  for (int k = 0; k < n; k++) buffer = std::copy_n(atom->v[list[k]], 3, buffer);
  return 3 * n;
}

void FixPythonMove::unpack_forward_comm(int n, int first, double *buffer)
{
  for (int i = first; i < first + n; i++, buffer += 3) std::copy_n(buffer, 3, atom->v[i]);
}

// End the run behind this step.

int64_t FixPythonMove::stop()
{
  stopped = true;
  return 0;
}

// Take from an axis of the atoms' coordinates in the box so many of y, and of z, about its centre; no further at once than to
// the next rank.

void FixPythonMove::shift_lamda(int axis, double y, double z)
{
  double width = domain->subhi_lamda[axis] - domain->sublo_lamda[axis], least = 0.0;
  MPI_Allreduce(&width, &least, 1, MPI_DOUBLE, MPI_MIN, world);
  const int parts = (int) std::ceil(0.5 * (std::fabs(y) + std::fabs(z)) / (0.9 * least));
  for (int part = 0; part < parts; part++) {
    double **x = atom->x;
    for (int i = 0; i < atom->nlocal; i++) x[i][axis] -= (y * (x[i][1] - 0.5) + z * (x[i][2] - 0.5)) / parts;
    domain->pbc();
    comm->exchange();
  }
}

// Have LAMMPS tally the virial in the first step from this one on that needs it.

void FixPythonMove::ask_for_pressure(bigint step)
{
  const bigint every = bridge.changes_box;
  own_compute(virial_id)->addstep((step - 1) % every ? (step + every - 1) / every * every : step);
}

// What virial is asked for in this step by others than this fix, whose own part of it the new box does not need.

int FixPythonMove::asked_by_others(int vflag) const
{
  const bigint step = update->ntimestep;
  if (!is(PRESSURE) || (vflag & (VIRIAL_ATOM | VIRIAL_CENTROID))) return vflag;
  if (output->any_time_dumps && output->next_time_dump_any == step) return vflag;
  for (const auto &compute : modify->get_compute_list())
    if (compute->pressflag && virial_id != compute->id && compute->matchstep(step)) return vflag;
  return 0;
}

// What LAMMPS's forces say of the pressure, where that is needed: their virial on all ranks, without this fix's.

void FixPythonMove::take_virial()
{
  if (!is(PRESSURE)) return;
  if (update->vflag_global != update->ntimestep)
    error->all(FLERR, problem("LAMMPS has not tallied the virial that the new box needs: begin the run with 'pre yes'"));
  std::vector<const double *> parts;
  if (force->pair) parts.push_back(force->pair->virial);
  if (atom->molecular != Atom::ATOMIC) {
    if (force->bond) parts.push_back(force->bond->virial);
    if (force->angle) parts.push_back(force->angle->virial);
    if (force->dihedral) parts.push_back(force->dihedral->virial);
    if (force->improper) parts.push_back(force->improper->virial);
  }
  for (const auto &fix : modify->get_fix_list())
    if (fix != this && fix->thermo_virial && !(bridge.counts && holds(fix))) parts.push_back(fix->virial);
  double sums[6] = {};
  for (const auto part : parts)
    for (int k = 0; k < 6; k++) sums[k] += part[k];
  MPI_Allreduce(sums, forces_virial, 6, MPI_DOUBLE, MPI_SUM, world);
  if (force->kspace)
    for (int k = 0; k < 6; k++) forces_virial[k] += force->kspace->virial[k];
  if (force->pair && force->pair->tail_flag)
    for (int k = 0; k < domain->dimension; k++) forces_virial[k] += force->pair->ptail / volume();
  ask_for_pressure(update->ntimestep + 1);
}

// The potential energy of the last forces, for which LAMMPS has tallied it. If a step has begun since, compute pe must not know.

double FixPythonMove::potential()
{
  const InPlace<bigint> step(update->ntimestep, update->eflag_global);
  return own_compute(energy_id)->compute_scalar();
}

// Atoms of bodies move by what is in place of their velocities, and forces are those there. LAMMPS takes atoms no further at once than to the next rank, so
// they go there in parts of the way.

void FixPythonMove::go_back()
{
  double width[3], least = 0.0, furthest = 0.0, all_furthest = 0.0;
  for (int k = 0; k < 3; k++)
    width[k] = domain->triclinic ? domain->prd[k] * (domain->subhi_lamda[k] - domain->sublo_lamda[k])
                                 : domain->subhi[k] - domain->sublo[k];
  const double own_least = *std::min_element(width, width + domain->dimension);
  MPI_Allreduce(&own_least, &least, 1, MPI_DOUBLE, MPI_MIN, world);
  auto moves = [this](int i) { return origin[i] != -1; };
  for (int i = 0; i < atom->nlocal; i++)
    for (int k = 0; k < 3 && moves(i); k++) furthest = std::max(furthest, std::fabs(atom->v[i][k]));
  MPI_Allreduce(&furthest, &all_furthest, 1, MPI_DOUBLE, MPI_MAX, world);
  const int parts = std::max(1, (int) std::ceil(all_furthest / (0.5 * least)));
  for (int part = 0; part < parts; part++) {
    for (int i = 0; i < atom->nlocal; i++)
      for (int k = 0; k < 3 && moves(i); k++) atom->x[i][k] += atom->v[i][k] / parts;
    if (domain->triclinic) domain->x2lamda(atom->nlocal);
    domain->pbc();
    if (domain->box_change) {    // as shrink-wrapped faces do
      domain->reset_box();
      comm->setup();
      if (neighbor->style) neighbor->setup_bins();
    }
    comm->exchange();
    if (domain->triclinic && part < parts - 1) domain->lamda2x(atom->nlocal);
  }
  renew_forces();
  push();
}

// What LAMMPS does in a step between the atoms' exchange and final_integrate, with new lists of neighbors.

void FixPythonMove::renew_forces()
{
  comm->borders();
  if (domain->triclinic) domain->lamda2x(atom->nlocal + atom->nghost);
  if (modify->n_pre_neighbor) modify->pre_neighbor();
  neighbor->build(1);
  if (modify->n_post_neighbor) modify->post_neighbor();

  const int vflag = bridge.vflag, eflag = 1 + 2 * (update->eflag_atom == update->ntimestep);    // of all, and of each atom
  const auto numbers = 3 * (size_t) (atom->nlocal + atom->nghost);
  for (double **array : {atom->f, atom->torque_flag ? atom->torque : nullptr})
    if (array && numbers) std::fill_n(array[0], numbers, 0.0);
  if (modify->n_pre_force) modify->pre_force(vflag);
  if (force->pair && force->pair->compute_flag) force->pair->compute(eflag, vflag);
  if (atom->molecular != Atom::ATOMIC) {
    if (force->bond) force->bond->compute(eflag, vflag);
    if (force->angle) force->angle->compute(eflag, vflag);
    if (force->dihedral) force->dihedral->compute(eflag, vflag);
    if (force->improper) force->improper->compute(eflag, vflag);
  }
  if (force->kspace && force->kspace->compute_flag) force->kspace->compute(eflag, vflag);
  if (modify->n_pre_reverse) modify->pre_reverse(eflag, vflag);
  if (force->newton) comm->reverse_comm();
  if (modify->n_post_force_any) modify->post_force(vflag);
}

// Do passes; returns what the first one that has found something wrong says, 0 if none has.

int64_t FixPythonMove::run(const Pass *pass)
{
  if (!pass) return 0;
  for (; pass->loop; pass++) {
    const int64_t found = pass->loop(pass->cells);
    throw_kept();
    if (found) return found;
  }
  bridge.changes++;
  return 0;
}

// Where each atom was when the class last noted its atoms. LAMMPS takes the number along when it sorts atoms, moves them to
// other ranks, adds and deletes some. What a class has lent of its bodies goes along to other ranks: there it is a row of
// what has arrived, from which it goes on if the atom does. The cell of what has arrived tells how many rows are of use.

void FixPythonMove::grow_arrays(int n)
{
  memory->grow(origin, n, "python/move:origin");
}

int FixPythonMove::pack_exchange(int i, double *buffer)
{
  const int64_t from = origin[i];
  buffer[0] = ubuf(from).d;
  if (!bridge.carries || from == -1) return 1;
  if (from < -1) {
    std::copy_n(&arrived[(-2 - from) * bridge.carries], bridge.carries, buffer);
  } else if (bridge.state) {
    const int64_t place = from & 0xffffffff;
    const int64_t body = reinterpret_cast<const int64_t *>(bridge.body_of[0])[place];
    auto column = [&buffer](const int64_t *cell, int64_t k) {
      auto values = reinterpret_cast<const double *>(cell[0]);
      for (int64_t row = 0; row < cell[1]; row++) *++buffer = values[row * cell[2] + k];
    };
    column(bridge.state, body);
    column(bridge.displace, place);
  } else {
    buffer[0] = ubuf((int64_t) -1).d;
    return 1;
  }
  return bridge.carries;
}

int FixPythonMove::unpack_exchange(int i, double *buffer)
{
  const int64_t from = origin[i] = ubuf(buffer[0]).i;
  if (!bridge.carries || from == -1) return 1;
  if (from >> 32 != comm->me && bridge.arrays) {    // else it is where its body knows it
    int64_t &rows = bridge.arrays[3 * ARRIVED + 1];
    origin[i] = -2 - rows;
    arrived.resize(rows++ * bridge.carries);
    arrived.insert(arrived.end(), buffer, buffer + bridge.carries);
  }
  return bridge.carries;
}

double FixPythonMove::memory_usage()
{
  return bridge.follows_atoms ? (double) atom->nmax * sizeof(int64_t) + arrived.capacity() * sizeof(double) : 0.0;
}

// Lines for screen and log. Warnings among them are counted, and left out, as thermo_modify warn has it of LAMMPS's own.

void FixPythonMove::log(const std::string &text) const
{
  if (comm->me) return;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("WARNING", 0) == 0) {
      const int most = error->get_maxwarn(), count = error->get_numwarn() + 1;
      error->set_numwarn(count);
      if (most != 0 && (most < 0 || count > most)) continue;
    }
    utils::logmesg(lmp, line + "\n");
  }
}

// What LAMMPS has logged must not wait in a buffer when a signal ends the run.

void FixPythonMove::flush_log() const
{
  if (logfile) fflush(logfile);
}

// Have room for the virial of each atom, if LAMMPS asks for it; the step may have brought new atoms since v_init.

void FixPythonMove::make_virial_per_atom()
{
  bridge.natoms = -1;    // whatever an error has left
  if (!bridge.wants_virial_per_atom || !(vflag_atom || cvflag_atom)) return;
  auto make = [this](int asked, double **&array, int &rows, int columns) {
    if (!asked || atom->nlocal <= rows) return;
    rows = atom->nmax;
    memory->destroy(array);
    memory->create(array, rows, columns, "fix:vatom");
  };
  make(vflag_atom, vatom, maxvatom, 6);
  make(cvflag_atom, cvatom, maxcvatom, 9);
  bridge.natoms = atom->nlocal;
  of_atoms.assign(9 * bridge.natoms, 0.0);
  bridge.virial_per_atom = of_atoms.data();
}

// Give LAMMPS the virial of each atom, as compute stress/atom and compute centroid/stress/atom have it.

void FixPythonMove::give_virial_per_atom()
{
  for (int i = 0; i < bridge.natoms; i++) {
    const double *own = &of_atoms[9 * i];
    if (vflag_atom) std::copy_n(own, 6, vatom[i]);
    if (cvflag_atom) std::copy_n(own, 9, cvatom[i]);
  }
  bridge.natoms = -1;
}

// Do something that may add to the virial, of all atoms and of each.

template <typename Function> void FixPythonMove::with_virial(Function function)
{
  make_virial_per_atom();
  if (bridge.arrays) {
    set_cell(VIRIAL, virial, 6, 0);
    set_cell(ATOM_VIRIAL, bridge.virial_per_atom, std::max(0, bridge.natoms), 9);
  }
  function();
  give_virial_per_atom();
}

// ----------------------------------------------------------------------
// errors
// ----------------------------------------------------------------------

template <typename... Types, typename... Values>
void FixPythonMove::call(int (*hook)(Types...), Values... arguments)
{
  if (!hook) return;
  bridge.array = nullptr;    // it may change
  strcpy(bridge.message, "interrupted");
  const int outcome = hook(arguments...);
  throw_kept();
  if (outcome == FAILED_ALIKE) error->all(FLERR, problem(bridge.message));
  if (outcome != DONE) end_run(bridge.message);
}

// This rank's Python failed. If all ranks fail, as on a mistake in the class, LAMMPS ends the run in
// order. But a rank that fails alone must not wait for others that wait for it in MPI; and error->one()
// of a LAMMPS inside Python only throws. So ranks that failed gather for a while, then stop the rest.

void FixPythonMove::end_run(const std::string &text, double patience)
{
  using namespace std::chrono;
  if (universe->nprocs == 1) all_at_argument(error, bridge.argument, problem(text));

  int all_failed = 0;
  MPI_Request gathering;
  MPI_Ibarrier(failing, &gathering);
  const auto start = steady_clock::now();
  do {
    std::this_thread::sleep_for(milliseconds(5));
    MPI_Test(&gathering, &all_failed, MPI_STATUS_IGNORE);
  } while (!all_failed && steady_clock::now() - start < duration<double>(patience));
  if (all_failed) all_at_argument(error, bridge.argument, problem(text));

  const auto report = "ERROR on proc " + std::to_string(comm->me) + ": " + problem(text) + "\n";
  fputs(report.c_str(), screen ? screen : stderr);
  if (logfile) fputs(report.c_str(), logfile);
  fflush(nullptr);
  std::this_thread::sleep_for(milliseconds(500));    // mpirun may drop what it has not yet read
  abort_all();
}

void FixPythonMove::abort_all() const
{
  MPI_Abort(universe->uworld, 1);
  abort();
}

// What a loop, or Python, calls must not throw into it. What LAMMPS throws on all ranks waits until they are back. An error of
// one rank alone ends the run at once, as it is said already: the others wait for this rank.

template <typename Function> int64_t FixPythonMove::kept_from_loops(Function function)
{
  try {
    return function();
  } catch (const LAMMPSAbortException &) {
    if (universe->nprocs > 1) {
      fflush(nullptr);
      abort_all();
    }
    kept = std::current_exception();
  } catch (...) {
    kept = std::current_exception();
  }
  return 0;
}

void FixPythonMove::throw_kept()
{
  if (kept) std::rethrow_exception(std::exchange(kept, nullptr));
}

// ----------------------------------------------------------------------
// registration with LAMMPS: its lammpsplugin.h is not among the installed headers
// ----------------------------------------------------------------------

struct lammpsplugin_t {
  const char *version, *style, *name, *info, *author;
  union {
    void *(*v1)(void *);
    void *(*v2)(void *, int, char **);
  } creator;
  void *handle;
};

// This code relies on the layout of LAMMPS's classes, so on the very version whose headers it saw. What it can use of that version
// without these, the library interface, it uses to see whether that LAMMPS was built of the same headers: see layout.h.

bool compiled_for(void *lmp)
{
  return lammps_version(lmp) == COMPILED_FOR_LAMMPS &&
      lammps_config_has_mpi_support() == sizeof(MPI_Comm) &&
      lammps_extract_setting(nullptr, "bigint") == sizeof(bigint) &&
      lammps_extract_setting(nullptr, "tagint") == sizeof(tagint) &&
      lammps_extract_setting(nullptr, "imageint") == sizeof(imageint);
}

// Before anything relies on the layout of LAMMPS's classes.

void refuse_other_layout(LAMMPS *lmp, const std::string &style)
{
  std::string problem;
  if (const char *obstacle = getenv("FIX_NOSQUISH_OBSTACLE")) problem = obstacle;
  else if (const char *differs = Layout(lmp).differs())
    problem = another_class(differs);
  if (problem.empty()) return;
  problem = "Fix " + style + ": " + problem;
  if (Layout(lmp).lammps()) lmp->error->all(FLERR, problem);
  lammps_error(lmp, LMP_ERROR_ALL, problem.c_str());
}

#include "computes.h"

void *make(void *lmp, int narg, char **arg)
{
  refuse_other_layout(static_cast<LAMMPS *>(lmp), arg[2]);
  return static_cast<Fix *>(new FixPythonMove(static_cast<LAMMPS *>(lmp), narg, arg));
}

// Python's callbacks and the end of the process come back to this code: it must not go. On Linux, the linker's flag sees to it.

void stay_loaded()
{
#ifdef __APPLE__
  Dl_info here;
  if (dladdr(reinterpret_cast<void *>(&stay_loaded), &here)) dlopen(here.dli_fname, RTLD_NOW | RTLD_NODELETE);
#endif
}

}    // namespace

extern "C" void lammpsplugin_init(void *lmp, void *handle, void *regfunc)
{
  if (!compiled_for(lmp)) {
    if (lammps_extract_setting(lmp, "world_rank") == 0)
      fprintf(stderr,
              "fix_nosquish: its plugin was compiled for LAMMPS %d, and this is %d or has other sizes of integers or another "
              "MPI, so it is not used. Install fix_nosquish again for this LAMMPS: see docs/install.md\n",
              COMPILED_FOR_LAMMPS, lammps_version(lmp));
    return;
  }
  stay_loaded();
  name_python_early();
  lammpsplugin_t plugin{};
  const Layout layout(static_cast<LAMMPS *>(lmp));
  plugin.version = layout.lammps() ? static_cast<LAMMPS *>(lmp)->version : "";
  plugin.style = "fix";
  plugin.name = PYTHON_MOVE.c_str();
  plugin.info = "fixes nosquish/* and python/move";
  plugin.author = "fix_nosquish";
  plugin.creator.v2 = make;
  plugin.handle = handle;
  const auto enter = reinterpret_cast<void (*)(lammpsplugin_t *, void *)>(regfunc);
  enter(&plugin, lmp);
  const bool alike = layout.styles();
  std::vector<std::string> styles(std::begin(NATIVE), std::end(NATIVE));
  for (const auto &name : REPLACED)
    for (const char *accelerated : {"", "/omp"}) styles.push_back(name + accelerated + SUFFIX);
  for (const auto &name : styles) {
    plugin.name = name.c_str();
    // the same without a line of the log for each
    if (alike) (*static_cast<LAMMPS *>(lmp)->modify->fix_map)[name] = reinterpret_cast<Modify::FixCreator>(make);
    else enter(&plugin, lmp);
  }
  if (!alike) return;    // each fix says why
  for (const auto &name : COMPUTES) (*static_cast<LAMMPS *>(lmp)->modify->compute_map)[name + SUFFIX] = make_compute;
}
