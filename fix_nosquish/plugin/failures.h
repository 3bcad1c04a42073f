/* Ends a run if something fails, on one rank or on all. */

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

  // End the run because Python has failed on this rank. If it fails on all ranks, as for an error in the class, LAMMPS ends the run
  // in order. If not, the others wait in MPI for this rank, and error->one() of a LAMMPS inside Python only throws. So ranks that
  // failed wait for each other for a while (patience, in seconds), and then abort.

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
    std::this_thread::sleep_for(milliseconds(500));    // else mpirun may lose the message
    abort_all();
  }

  // Call a function from a loop or from Python, into which no exception may pass. `rethrow` throws an error on all ranks later. An
  // error on one rank ends the run at once, because the other ranks wait for it; LAMMPS has printed it.

  template <typename Function> auto guarded(Function function)
  {
    try {
      return function();
    } catch (const LAMMPSAbortException &) {
      pending = std::current_exception();
      fflush(nullptr);
      if (universe->nprocs > 1) abort_all();
    } catch (...) {
      pending = std::current_exception();
    }
    return decltype(function())();
  }

  void rethrow()
  {
    if (pending) std::rethrow_exception(std::exchange(pending, nullptr));
  }

 private:
  MPI_Comm failing = MPI_COMM_NULL;    // of ranks whose Python failed
  std::exception_ptr pending;          // an exception of LAMMPS

  [[noreturn]] void abort_all() const
  {
    MPI_Abort(universe->uworld, 1);
    abort();
  }
};

}    // namespace nosquish
}    // namespace

#endif
