/* How a run ends when something fails, on one rank or on all. */

#ifndef FIX_NOSQUISH_FAILURES_H
#define FIX_NOSQUISH_FAILURES_H

#include "part.h"

#include "universe.h"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <thread>
#include <utility>

namespace {
namespace nosquish {

class Failures : public Part {
 public:
  Failures(LAMMPS *lmp, Fix *fix, Bridge &bridge) : Part(lmp, fix, bridge)    // collective
  {
    if (universe->nprocs > 1) MPI_Comm_dup(world, &failing);
  }

  ~Failures() override
  {
    int finalized;
    MPI_Finalized(&finalized);
    if (failing != MPI_COMM_NULL && !finalized) MPI_Comm_free(&failing);
  }

  // This rank's Python failed. If all ranks fail, as on a mistake in the class, LAMMPS ends the run in order. But a rank that fails
  // alone must not wait for others, which wait for it in MPI; and error->one() of a LAMMPS inside Python only throws. So ranks that
  // failed gather for a while (patience, in seconds), and then stop the others.

  [[noreturn]] void end_run(const std::string &text, double patience = 2.0)
  {
    using namespace std::chrono;
    int all_failed = universe->nprocs == 1;
    MPI_Request gathering;
    if (!all_failed) MPI_Ibarrier(failing, &gathering);
    for (const auto start = steady_clock::now(); !all_failed && steady_clock::now() - start < duration<double>(patience);) {
      std::this_thread::sleep_for(milliseconds(5));
      MPI_Test(&gathering, &all_failed, MPI_STATUS_IGNORE);
    }
    if (all_failed) end_on_all(lmp, problem(fix, text), bridge.argument);

    const auto report = "ERROR on proc " + std::to_string(comm->me) + ": " + problem(fix, text) + "\n";
    fputs(report.c_str(), screen ? screen : stderr);
    if (logfile) fputs(report.c_str(), logfile);
    fflush(nullptr);
    std::this_thread::sleep_for(milliseconds(500));    // mpirun may drop what it has not yet read
    abort_all();
  }

  // What a loop, or Python, calls must not throw into it. What LAMMPS throws on all ranks waits until they are back. An error of
  // one rank alone ends the run at once, because the other ranks wait for this one; LAMMPS has printed it.

  template <typename Function> auto kept_from_loops(Function function)
  {
    try {
      return function();
    } catch (const LAMMPSAbortException &) {
      kept = std::current_exception();
      fflush(nullptr);
      if (universe->nprocs > 1) abort_all();
    } catch (...) {
      kept = std::current_exception();
    }
    return decltype(function())();
  }

  void throw_kept()
  {
    if (kept) std::rethrow_exception(std::exchange(kept, nullptr));
  }

 private:
  MPI_Comm failing = MPI_COMM_NULL;    // of ranks whose Python failed
  std::exception_ptr kept;             // what LAMMPS has thrown below loops

  [[noreturn]] void abort_all() const
  {
    MPI_Abort(universe->uworld, 1);
    abort();
  }
};

// Another value in some place, until the block ends, also where LAMMPS throws.

template <typename T> class InPlace {
 public:
  InPlace(T &place, T value) : place(place), former(std::exchange(place, value)) {}
  ~InPlace() { place = former; }
  InPlace(const InPlace &) = delete;

 private:
  T &place;
  const T former;
};

}    // namespace nosquish
}    // namespace

#endif
