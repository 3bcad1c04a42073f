/* fix python/move for a LAMMPS that was built without its PYTHON package.

   A LAMMPS plugin, and a superset of LAMMPS's own fix python/move. The fix line names a Python class,

       fix ID group python/move "module.class"

   and the fix calls the methods of one instance of it. Everything that is Python's is in bridge.py;
   the two sides share the plain C struct Bridge. From Python itself a few functions are called, looked
   up by name at run time, so that one compiled plugin serves every Python version. */

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "fix.h"
#include "group.h"
#include "library.h"
#include "memory.h"
#include "modify.h"
#include "output.h"
#include "universe.h"
#include "update.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <string>
#include <thread>
#include <unistd.h>
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
// the command alone. Linux can tell the child of its parent's end.

void end_with_parent(const std::string &executable)
{
#ifdef __linux__
  const auto parents = "/proc/" + std::to_string(getppid()) + "/exe";
  char *of_parent = realpath(parents.c_str(), nullptr);
  char *of_python = realpath(executable.c_str(), nullptr);
  if (of_parent && of_python && strcmp(of_parent, of_python) == 0) prctl(PR_SET_PDEATHSIG, SIGTERM);
  free(of_parent);
  free(of_python);
#else
  (void) executable;
#endif
}

// Make sure that Python runs in this process; return what prevents it, or nothing. In a native lmp
// nothing of Python is there: the lmp command, which is a Python script, leaves the path of its
// interpreter and of that interpreter's shared library in the environment.

std::string start_python()
{
  auto is_initialized = symbol<int()>("Py_IsInitialized");
  if (is_initialized && is_initialized()) return "";

  const char *setting = getenv("FIX_NOSQUISH_PYTHON");
  if (!setting)
    return "no Python in this process: start LAMMPS by the command lmp that stands beside the python "
           "for which fix_nosquish is installed, or by: python -m fix_nosquish -in FILE";
  const std::string both = setting, executable = both.substr(0, both.find(':'));
  const std::string library = both.substr(executable.size() + 1);
  const std::string instead = ": use instead python -m fix_nosquish -in FILE";

  end_with_parent(executable);
  if (!is_initialized) {
    if (library.empty()) return "the Python " + executable + " has no shared libpython" + instead;
    if (!dlopen(library.c_str(), RTLD_NOW | RTLD_GLOBAL)) return dlerror() + instead;
  }
  auto decode = symbol<wchar_t *(const char *, size_t *)>("Py_DecodeLocale");
  auto set_program_name = symbol<void(const wchar_t *)>("Py_SetProgramName");
  auto initialize = symbol<void(int)>("Py_InitializeEx");
  auto run = symbol<int(const char *)>("PyRun_SimpleString");
  auto let_go = symbol<void *()>("PyEval_SaveThread");
  if (!decode || !set_program_name || !initialize || !run || !let_go)
    return "cannot start Python from " + library + instead;

  set_program_name(decode(executable.c_str(), nullptr));    // finds the packages of its venv
  initialize(0);
  // Ctrl-C ends LAMMPS at once, as it does without Python: module signal would change that when a class
  // imports it
  run("import signal as s\n"
      "if s.getsignal(s.SIGINT) is s.default_int_handler: s.signal(s.SIGINT, s.SIG_DFL)\n"
      "del s");
  // this interpreter is never taken down, so nothing may wait in its buffers
  run("__import__('sys').stdout.reconfigure(line_buffering=True)");
  let_go();
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
// what the two sides share, mirrored in bridge.py and passes.py
// ----------------------------------------------------------------------

// what a hook returns; 0 is left by a callback that itself broke, as on an interrupt
enum Outcome : int { BROKEN = 0, DONE = 1, FAILED_ALIKE = 2, FAILED_HERE = 3 };

struct FixFacts {
  const char *id, *style;
  int32_t groupbit;
  int32_t time_integrate;
  int32_t between;    // called between initial_integrate and final_integrate
  int32_t end_of_step;
  int32_t nevery;
  int32_t final_integrate;
  int32_t box_change;
};

// Compiled loops that Python has bound to their arguments, and messages between ranks. Each works on cells: a few
// integers each, which are a number, or an array's address and shape.

enum PassKind : int32_t { END = 0, LOOP = 1, DELIVERY = 2, EXCHANGE = 3, COMPLETION = 4, AGREEMENT = 5 };

struct Pass {
  int32_t kind;
  int32_t comm;    // as Fortran has it
  int64_t (*loop)(const int64_t *);    // returns 0 if all is well
  const int64_t *cells;    // their addresses; 0 after the last one of a pass that is no loop

  int64_t *cell(int k) const { return reinterpret_cast<int64_t *>(cells[k]); }
  int64_t *array(int k) const { return reinterpret_cast<int64_t *>(cell(k)[0]); }
  MPI_Comm world() const { return MPI_Comm_f2c(comm); }
};

// what an agreement adds up over all ranks
enum Found { CAME, MORE, LACKING, MOVED, SUMMED };
// cells for LAMMPS's arrays
enum Arrays { X_CELL, V_CELL, F_CELL, MASK_CELL, ORIGIN_CELL, ARRIVED_CELL };
// tags of messages; that of an exchange is the same in sharing.py
enum Tag { EXCHANGE_TAG = 3, QUESTION_TAG, ANSWER_TAG };

struct Bridge {
  // facts
  int32_t size;
  int32_t outcome;         // set by Python: how making the instance went
  // set by Python: what the instance has besides its methods
  int32_t wants_virial;             // it fills in virial
  int32_t wants_virial_per_atom;    // it fills in virial_per_atom
  int32_t writes_restart_file;
  int32_t rigid;                    // it is a rigid fix to those that ask for the bodies
  int32_t follows_atoms;            // it asks where its atoms were
  int32_t carries;                  // numbers that go with an atom to another rank
  int32_t vector_size;
  int32_t array_columns;
  int32_t array_rows;    // -1: not known from the start
  const int32_t *vector_extensive;
  int32_t *body;        // of each local atom, -1 for none; null while not known
  double *masstotal;    // of each body
  // of the fix
  void *fix;               // first argument of the functions below
  void *lammps;
  const char *fix_id, *group, *target;
  double *virial;
  double *virial_per_atom;    // (natoms, 6)
  int32_t natoms;             // -1 while LAMMPS asks for no virial per atom
  const int64_t *next_output;    // the step of the next output
  const int *nlocal;             // the number of local atoms
  const int64_t *origins;        // where each of them was when it was noted; see FixPythonMove
  // set by Python: what goes without it
  int32_t may_wait;           // the end of a step may wait for the next step
  int32_t look_every;         // but not where its number is a multiple of this (0: of none)
  int32_t waiting;            // it does
  const Pass *step;           // instead of initial_integrate, after a step that waits; null if Python must
  const Pass *neighbor;       // instead of post_neighbor; null if Python must
  int32_t moving;             // how many of these passes are for atoms that have moved
  int64_t *arrays;            // cells for LAMMPS's arrays
  const int64_t *index, *body_of, *d, *state;    // cells of the bodies; null if there are none
  // functions of the fix
  void (*log)(void *fix, const char *text);
  int (*nth_fix)(void *fix, int n, FixFacts *);    // 0 past the last; id is null for this fix
  int (*ghost_velocity)(void *fix);
  void (*set_array_rows)(void *fix, int n);
  void (*note)(void *fix, int n, const int32_t *index);
  void (*keep)(void *fix);    // the passes are for the box as it is now
  void (*point)(void *fix);   // point the cells for LAMMPS's arrays at them
  // methods of the instance, null where it has none
  int (*init)();
  int (*setup)(int vflag);
  int (*min_setup)(int vflag);
  int (*post_neighbor)();
  int (*initial_integrate)(int vflag);
  int (*final_integrate)();
  int (*initial_integrate_respa)(int vflag, int ilevel, int iloop);
  int (*final_integrate_respa)(int ilevel, int iloop);
  int (*reset_dt)();
  int (*end_of_step)();
  int (*post_run)();
  int (*write_restart_file)(const char *name);
  int (*dof)(int igroup, int64_t *count);
  int (*compute_scalar)(double *value);
  int (*compute_vector)(int i, double *value);
  int (*compute_array)(int i, int j, double *value);
  void (*release)(void *bridge);
  // set by a hook that fails
  char message[4096];
};

// ----------------------------------------------------------------------
// the fix
// ----------------------------------------------------------------------

class FixPythonMove : public Fix {
 public:
  FixPythonMove(LAMMPS *, int, char **);
  ~FixPythonMove() override;
  int setmask() override;
  void init() override;
  void setup(int) override;
  void min_setup(int) override;
  void setup_post_neighbor() override { post_neighbor(); }
  void post_neighbor() override;
  void initial_integrate(int) override;
  void final_integrate() override;
  void initial_integrate_respa(int, int, int) override;
  void final_integrate_respa(int, int) override;
  void end_of_step() override;
  void post_run() override;
  void write_restart_file(const char *) override;
  void reset_dt() override;
  bigint dof(int) override;
  double compute_scalar() override;
  double compute_vector(int) override;
  double compute_array(int, int) override;
  void *extract(const char *, int &) override;
  void grow_arrays(int) override;
  void copy_arrays(int i, int j, int) override { origin[j] = origin[i]; }
  void set_arrays(int i) override { origin[i] = -1; }
  int pack_exchange(int, double *) override;
  int unpack_exchange(int, double *) override;
  double memory_usage() override;

 private:
  Bridge bridge;
  MPI_Comm failing;    // for ranks whose Python failed
  bool respa = false;
  std::vector<int> extensive;
  int last_vflag = 0;
  std::vector<double> kept_box;
  // of each atom: rank << 32 | place when it was noted, -1 if it was not, -2 - row if it came with that row of what has arrived
  int64_t *origin = nullptr;
  std::vector<double> arrived;
  std::vector<MPI_Request> requests;
  std::vector<int64_t> senders[2], sent[2], numbers[2];    // what came with questions, with answers

  static FixPythonMove *self(void *fix) { return static_cast<FixPythonMove *>(fix); }
  int describe(int, FixFacts *) const;
  void note(int, const int32_t *);
  void point();
  std::vector<double> box() const;
  bool run(const Pass *);
  bool follow();
  void exchange(const Pass &);
  void complete();
  bool deliver(const Pass &, bool);
  std::string problem(const std::string &text) const
  {
    return "Fix " + std::string(id) + " python/move: " + text;
  }
  [[noreturn]] void end_run(const std::string &text, double patience = 2.0);
  void flush_log() const;
  template <typename... Types, typename... Values>
  void call(int (*hook)(Types...), Values... arguments);
  template <typename... Types, typename... Values>
  void call_with_virial(int (*hook)(Types...), Values... arguments);
};

FixPythonMove::FixPythonMove(LAMMPS *lmp, int narg, char **arg) :
    Fix(lmp, narg, arg), bridge(), failing(MPI_COMM_NULL)
{
  if (narg < 4) utils::missing_cmd_args(FLERR, "fix python/move", error);
  if (narg > 4)
    error->all(FLERR, problem("put the class and its words in quotes: \"" + std::string(arg[3]) +
                              " " + arg[4] + " ...\""));

  time_integrate = 1;
  dynamic_group_allow = 1;

  if (universe->nprocs > 1) MPI_Comm_dup(world, &failing);

  const auto obstacle = start_python();
  if (!obstacle.empty()) error->all(FLERR, problem(obstacle));

  const std::string target = arg[3];
  bridge.size = sizeof(Bridge);
  bridge.fix = this;
  bridge.lammps = lmp;
  bridge.fix_id = id;
  bridge.group = group->names[igroup];
  bridge.target = target.c_str();
  bridge.virial = virial;
  bridge.log = [](void *fix, const char *text) {
    auto lmp = self(fix)->lmp;
    if (lmp->comm->me == 0) utils::logmesg(lmp, std::string(text));
  };
  bridge.nth_fix = [](void *fix, int n, FixFacts *facts) { return self(fix)->describe(n, facts); };
  bridge.ghost_velocity = [](void *fix) { return self(fix)->comm->ghost_velocity; };
  bridge.set_array_rows = [](void *fix, int n) { self(fix)->size_array_rows = n; };
  bridge.note = [](void *fix, int n, const int32_t *index) { self(fix)->note(n, index); };
  bridge.keep = [](void *fix) { self(fix)->kept_box = self(fix)->box(); };
  bridge.point = [](void *fix) { self(fix)->point(); };
  bridge.natoms = -1;
  bridge.next_output = &output->next;
  bridge.nlocal = &atom->nlocal;
  strcpy(bridge.message, "cannot import fix_nosquish.plugin.bridge");

  const auto address = std::to_string(reinterpret_cast<uintptr_t>(&bridge));
  run_python("__import__('fix_nosquish.plugin.bridge', fromlist=['attach']).attach(" + address + ")");
  bridge.target = nullptr;
  if (bridge.outcome != DONE) end_run(bridge.message, 5.0);    // imports may take their time

  if (bridge.dof) dof_flag = 1;
  if (bridge.wants_virial) virial_global_flag = thermo_virial = 1;
  if (bridge.wants_virial_per_atom) virial_peratom_flag = thermo_virial = 1;
  restart_file = bridge.writes_restart_file;
  rigid_flag = bridge.rigid;

  scalar_flag = bridge.compute_scalar != nullptr;
  extscalar = extarray = 0;
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

  if (bridge.follows_atoms) {
    create_attribute = 1;
    maxexchange = std::max(1, bridge.carries);
    atom->add_callback(Atom::GROW);
    grow_arrays(atom->nmax);
    note(0, nullptr);
  }
}

FixPythonMove::~FixPythonMove()
{
  if (bridge.follows_atoms && modify->get_fix_by_id(id)) atom->delete_callback(id, Atom::GROW);
  memory->destroy(origin);
  if (bridge.release) bridge.release(&bridge);
  int finalized;
  MPI_Finalized(&finalized);
  if (failing != MPI_COMM_NULL && !finalized) MPI_Comm_free(&failing);
}

int FixPythonMove::setmask()
{
  return INITIAL_INTEGRATE | FINAL_INTEGRATE | INITIAL_INTEGRATE_RESPA | FINAL_INTEGRATE_RESPA |
      (bridge.post_neighbor ? POST_NEIGHBOR : 0) | (bridge.end_of_step ? END_OF_STEP : 0) |
      (bridge.post_run ? POST_RUN : 0);
}

void FixPythonMove::init()
{
  respa = utils::strmatch(update->integrate_style, "^respa");
  if (respa && !(bridge.initial_integrate_respa && bridge.final_integrate_respa))
    error->all(FLERR, problem("its class has no methods for run_style respa"));
  if (update->whichflag == 2) call(bridge.min_setup, 0);    // before pair styles that look bodies up
  call(bridge.init);
}

void FixPythonMove::setup(int vflag)
{
  v_init(vflag);
  call_with_virial(bridge.setup, vflag);
}

void FixPythonMove::min_setup(int vflag)
{
  call(bridge.min_setup, vflag);
}

void FixPythonMove::post_neighbor()
{
  if (bridge.neighbor && box() == kept_box && follow()) return;
  call(bridge.post_neighbor);
}

void FixPythonMove::initial_integrate(int vflag)
{
  if (!bridge.initial_integrate) end_run("the Python that holds its class has shut down");
  flush_log();
  v_init(vflag);
  last_vflag = vflag;
  if (bridge.waiting && bridge.step && !vflag && run(bridge.step))
    bridge.waiting = 0;
  else
    call(bridge.initial_integrate, vflag);
}

// On a step that nothing looks at, its end can wait for the next step, and be one pass with its begin.

void FixPythonMove::final_integrate()
{
  const bigint step = update->ntimestep;
  bridge.waiting = bridge.may_wait && !last_vflag && step != output->next &&
      (bridge.look_every == 0 || step % bridge.look_every);
  if (!bridge.waiting) call_with_virial(bridge.final_integrate);
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

// Granular pair styles look up the mass of the body of each atom here.

void *FixPythonMove::extract(const char *name, int &dim)
{
  dim = 1;
  if (strcmp(name, "body") == 0) return bridge.body;
  if (strcmp(name, "masstotal") == 0) return bridge.masstotal;
  return nullptr;
}

// Verlet needs no such call: its final_integrate is as late.

void FixPythonMove::end_of_step()
{
  if (respa) call_with_virial(bridge.end_of_step);
}

void FixPythonMove::post_run()
{
  call(bridge.post_run);
}

void FixPythonMove::write_restart_file(const char *name)
{
  call(bridge.write_restart_file, name);
}

void FixPythonMove::reset_dt()
{
  call(bridge.reset_dt);
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
  double value = 0.0;
  call(bridge.compute_vector, i, &value);
  return value;
}

double FixPythonMove::compute_array(int i, int j)
{
  double value = 0.0;
  if (i < size_array_rows) call(bridge.compute_array, i, j, &value);    // LAMMPS asks for other rows too
  return value;
}

int FixPythonMove::describe(int n, FixFacts *facts) const
{
  if (n >= modify->nfix) return 0;
  const int between = POST_INTEGRATE | PRE_EXCHANGE | PRE_NEIGHBOR | POST_NEIGHBOR | PRE_FORCE |
      PRE_REVERSE | POST_FORCE | POST_INTEGRATE_RESPA | PRE_FORCE_RESPA | POST_FORCE_RESPA;
  const Fix *other = modify->fix[n];
  if (!other || other == this)
    *facts = FixFacts();
  else
    *facts = {other->id, other->style, other->groupbit, other->time_integrate,
              (modify->fmask[n] & between) != 0, (modify->fmask[n] & END_OF_STEP) != 0, other->nevery,
              (modify->fmask[n] & FINAL_INTEGRATE) != 0,
              (other->box_change & ~BOX_CHANGE_DOMAIN) != 0};    // ranks' parts of the box are not the box
  return 1;
}

// Point the cells for LAMMPS's arrays at them as they are.

void FixPythonMove::point()
{
  const int64_t n = atom->nlocal, width = bridge.carries;
  auto set = [this](int cell, const void *array, int64_t rows, int64_t columns) {
    auto numbers = bridge.arrays + 3 * cell;
    numbers[0] = reinterpret_cast<int64_t>(array);
    numbers[1] = rows;
    numbers[2] = columns;
  };
  set(X_CELL, n ? atom->x[0] : nullptr, n, 3);
  set(V_CELL, n ? atom->v[0] : nullptr, n, 3);
  set(F_CELL, n ? atom->f[0] : nullptr, n, 3);
  set(MASK_CELL, atom->mask, n, 0);
  set(ORIGIN_CELL, origin, n, 0);
  set(ARRIVED_CELL, arrived.data(), arrived.size() / width, width);
}

std::vector<double> FixPythonMove::box() const
{
  std::vector<double> numbers(domain->boxlo, domain->boxlo + 3);
  numbers.insert(numbers.end(), domain->boxhi, domain->boxhi + 3);
  numbers.insert(numbers.end(), {domain->xy, domain->xz, domain->yz});
  return numbers;
}

// Do passes without Python; returns whether all went well. If not, Python does it all again, and says why.

bool FixPythonMove::run(const Pass *pass)
{
  for (; pass->kind != END; pass++) {
    if (pass->kind == EXCHANGE) {
      exchange(*pass);
    } else if (pass->kind == COMPLETION) {
      complete();
    } else if (pass->loop(pass->cells)) {
      complete();
      return false;
    }
  }
  return true;
}

// Follow the atoms without Python, as Bodies.follow does; on all ranks or on none. All ranks take part in all messages, whatever
// went wrong on one of them, and agree at the end.

bool FixPythonMove::follow()
{
  point();
  const Pass *pass = bridge.neighbor;
  (pass->loop)(pass->cells);
  pass++;

  const Pass &agreement = *pass++;
  int64_t sums[SUMMED];
  std::copy_n(agreement.array(0), (int) SUMMED, sums);
  if (comm->nprocs > 1) MPI_Allreduce(MPI_IN_PLACE, sums, SUMMED, MPI_INT64_T, MPI_SUM, agreement.world());
  if (sums[CAME] || sums[MORE] || (sums[MOVED] && sums[LACKING])) return false;

  int failed = 0;
  if (sums[MOVED]) {
    for (int k = 0; k < bridge.moving; k++) {
      if (pass[k].kind == DELIVERY)
        failed |= !deliver(pass[k], failed);
      else
        failed = failed || pass[k].loop(pass[k].cells);
    }
    note(bridge.index[1], reinterpret_cast<const int32_t *>(bridge.index[0]));
  }
  pass += bridge.moving;
  failed = failed || pass->loop(pass->cells);
  if (comm->nprocs > 1) MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_MAX, agreement.world());
  return !failed && (!sums[MOVED] || run(pass + 1));
}

// As World.exchange: begin to send each partner its part, and to receive theirs.

void FixPythonMove::exchange(const Pass &pass)
{
  const int64_t *partners = pass.array(0), *shares = pass.array(1);
  const int64_t n = *pass.cell(2), rows = *pass.cell(3);
  auto send = reinterpret_cast<const double *>(pass.array(4));
  auto receive = reinterpret_cast<double *>(pass.array(5));
  requests.resize(2 * n);
  for (int64_t p = 0, done = 0; p < n; done += rows * shares[p++]) {
    const int count = rows * shares[p];
    MPI_Irecv(receive + done, count, MPI_DOUBLE, partners[p], EXCHANGE_TAG, pass.world(), &requests[2 * p]);
    MPI_Isend(send + done, count, MPI_DOUBLE, partners[p], EXCHANGE_TAG, pass.world(), &requests[2 * p + 1]);
  }
}

void FixPythonMove::complete()
{
  if (!requests.empty()) MPI_Waitall(requests.size(), requests.data(), MPI_STATUSES_IGNORE);
  requests.clear();
}

// As World.deliver: send each of some ranks its part, and receive what others send to this one: from whom is known if these are
// answers. A rank that has failed has none, and where an answer is missing that rank has failed: returns whether all have come.

bool FixPythonMove::deliver(const Pass &pass, bool failed)
{
  const int64_t *to = pass.array(0), *many = pass.array(1), *part = pass.array(2);
  const MPI_Comm world = pass.world();
  const bool answers = pass.cells[7];
  const int tag = answers ? ANSWER_TAG : QUESTION_TAG;
  auto &from = senders[answers], &counts = sent[answers], &all = numbers[answers];
  from.clear();
  counts.clear();
  all.clear();
  std::vector<std::pair<int, std::vector<int64_t>>> parts;

  requests.clear();
  for (int64_t r = 0; r < *pass.cell(3); r++) {
    const int64_t count = failed ? 0 : many[r];
    if (to[r] == comm->me) {
      parts.emplace_back(comm->me, std::vector<int64_t>(part, part + count));
    } else {
      requests.emplace_back();
      if (answers)
        MPI_Isend(part, count, MPI_INT64_T, to[r], tag, world, &requests.back());
      else
        MPI_Issend(part, count, MPI_INT64_T, to[r], tag, world, &requests.back());
    }
    part += count;
  }
  auto receive = [&](MPI_Message message, const MPI_Status &status) {
    int count;
    MPI_Get_count(&status, MPI_INT64_T, &count);
    parts.emplace_back(status.MPI_SOURCE, std::vector<int64_t>(count));
    MPI_Mrecv(parts.back().second.data(), count, MPI_INT64_T, &message, MPI_STATUS_IGNORE);
  };
  MPI_Message message;
  MPI_Status status;
  if (answers) {
    const int64_t *sources = pass.array(7);
    for (int64_t r = 0; r < *pass.cell(8); r++) {
      if (sources[r] == comm->me) continue;
      MPI_Mprobe(sources[r], tag, world, &message, &status);
      receive(message, status);
    }
    complete();
  } else {
    // The barrier is entered when all that was sent is being received (see World.deliver). No rank is a round ahead: the
    // agreement at the end of follow() keeps rounds apart.
    MPI_Request barrier;
    for (int entered = 0, over = 0; !over;) {
      int there, done;
      MPI_Improbe(MPI_ANY_SOURCE, tag, world, &there, &message, &status);
      if (there) {
        receive(message, status);
      } else if (!entered) {
        MPI_Testall(requests.size(), requests.data(), &done, MPI_STATUSES_IGNORE);
        if (done) entered = MPI_Ibarrier(world, &barrier) == MPI_SUCCESS;
      } else {
        MPI_Test(&barrier, &over, MPI_STATUS_IGNORE);
      }
    }
  }
  requests.clear();
  std::sort(parts.begin(), parts.end());
  for (const auto &one : parts) {
    from.push_back(one.first);
    counts.push_back(one.second.size());
    all.insert(all.end(), one.second.begin(), one.second.end());
    if (answers && one.second.empty()) failed = true;
  }
  for (int k = 0; k < 3; k++) {
    const auto &values = k == 0 ? from : k == 1 ? counts : all;
    pass.cell(4 + k)[0] = reinterpret_cast<int64_t>(values.data());
    pass.cell(4 + k)[1] = values.size();
  }
  return !failed;
}

// Where each atom was when the class last noted its atoms. LAMMPS takes the number along when it sorts atoms,
// moves them to other ranks, adds and deletes some. What a class has lent of its bodies goes along to other ranks: there
// it is a row of what has arrived, from which it goes on if the atom does.

void FixPythonMove::note(int n, const int32_t *index)
{
  std::fill_n(origin, atom->nlocal, -1);
  for (int place = 0; place < n; place++) origin[index[place]] = (int64_t) comm->me << 32 | place;
  arrived.clear();
}

void FixPythonMove::grow_arrays(int n)
{
  memory->grow(origin, n, "python/move:origin");
  bridge.origins = origin;
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
    column(bridge.d, place);
    column(bridge.state, body);
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
  if (from >> 32 != comm->me) {    // else it is where its body knows it
    origin[i] = -2 - (int64_t) (arrived.size() / bridge.carries);
    arrived.insert(arrived.end(), buffer, buffer + bridge.carries);
  }
  return bridge.carries;
}

double FixPythonMove::memory_usage()
{
  return bridge.follows_atoms ? (double) atom->nmax * sizeof(int64_t) + arrived.capacity() * sizeof(double) : 0.0;
}

// What LAMMPS has logged must not wait in a buffer when a signal ends the run.

void FixPythonMove::flush_log() const
{
  if (logfile) fflush(logfile);
}

// Call a hook that may fill in the virial of each atom. The step may have brought new atoms since v_init.

template <typename... Types, typename... Values>
void FixPythonMove::call_with_virial(int (*hook)(Types...), Values... arguments)
{
  if (bridge.wants_virial_per_atom && vflag_atom) {
    if (atom->nlocal > maxvatom) {
      maxvatom = atom->nmax;
      memory->destroy(vatom);
      memory->create(vatom, maxvatom, 6, "fix:vatom");
    }
    bridge.natoms = atom->nlocal;
    bridge.virial_per_atom = vatom ? vatom[0] : nullptr;
    std::fill_n(bridge.virial_per_atom, 6 * bridge.natoms, 0.0);
  }
  call(hook, arguments...);
  bridge.natoms = -1;
}

// ----------------------------------------------------------------------
// errors
// ----------------------------------------------------------------------

template <typename... Types, typename... Values>
void FixPythonMove::call(int (*hook)(Types...), Values... arguments)
{
  if (!hook) return;
  strcpy(bridge.message, "interrupted");
  const int outcome = hook(arguments...);
  if (outcome == FAILED_ALIKE) error->all(FLERR, problem(bridge.message));
  if (outcome != DONE) end_run(bridge.message);
}

// This rank's Python failed. If all ranks fail, as on a mistake in the class, LAMMPS ends the run in
// order. But a rank that fails alone must not wait for others that wait for it in MPI; and error->one()
// of a LAMMPS inside Python only throws. So ranks that failed gather for a while, then stop the rest.

void FixPythonMove::end_run(const std::string &text, double patience)
{
  using namespace std::chrono;
  if (universe->nprocs == 1) error->one(FLERR, problem(text));

  int all_failed = 0;
  MPI_Request gathering;
  MPI_Ibarrier(failing, &gathering);
  const auto start = steady_clock::now();
  do {
    std::this_thread::sleep_for(milliseconds(5));
    MPI_Test(&gathering, &all_failed, MPI_STATUS_IGNORE);
  } while (!all_failed && steady_clock::now() - start < duration<double>(patience));
  if (all_failed) error->all(FLERR, problem(text));

  const auto report = "ERROR on proc " + std::to_string(comm->me) + ": " + problem(text) + "\n";
  fputs(report.c_str(), screen ? screen : stderr);
  if (logfile) fputs(report.c_str(), logfile);
  fflush(nullptr);
  std::this_thread::sleep_for(milliseconds(500));    // mpirun may drop what it has not yet read
  MPI_Abort(universe->uworld, 1);
  abort();
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

// This code relies on the layout of LAMMPS's classes, so on the very version whose headers it saw.

bool compiled_for(void *lmp)
{
  return lammps_version(lmp) == COMPILED_FOR_LAMMPS &&
      lammps_config_has_mpi_support() == sizeof(MPI_Comm) &&
      lammps_extract_setting(nullptr, "bigint") == sizeof(bigint) &&
      lammps_extract_setting(nullptr, "tagint") == sizeof(tagint) &&
      lammps_extract_setting(nullptr, "imageint") == sizeof(imageint);
}

}    // namespace

extern "C" void lammpsplugin_init(void *lmp, void *handle, void *regfunc)
{
  if (!compiled_for(lmp)) {
    if (lammps_extract_setting(lmp, "world_rank") == 0)
      fprintf(stderr, "fix_nosquish: its plugin is for another LAMMPS, and not used\n");
    return;
  }
  lammpsplugin_t plugin{};
  plugin.version = static_cast<LAMMPS *>(lmp)->version;
  plugin.style = "fix";
  plugin.name = "python/move";
  plugin.info = "fix python/move";
  plugin.author = "fix_nosquish";
  plugin.creator.v2 = [](void *lmp, int narg, char **arg) -> void * {
    return static_cast<Fix *>(new FixPythonMove(static_cast<LAMMPS *>(lmp), narg, arg));
  };
  plugin.handle = handle;
  reinterpret_cast<void (*)(lammpsplugin_t *, void *)>(regfunc)(&plugin, lmp);
}
