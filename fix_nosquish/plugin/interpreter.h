/* Finds or starts Python in this process. The few functions of Python's C interface that are used are looked up at run time, so one
   plugin works with every version of Python. */

#ifndef FIX_NOSQUISH_INTERPRETER_H
#define FIX_NOSQUISH_INTERPRETER_H

#include <cstdlib>
#include <dlfcn.h>
#include <sstream>
#include <string>
#include <unistd.h>
#ifdef __linux__
#include <csignal>
#include <sys/prctl.h>
#endif

namespace {
namespace nosquish {

template <typename Function> Function *symbol(const char *name)
{
  return reinterpret_cast<Function *>(dlsym(RTLD_DEFAULT, name));
}

// If the command lmp of the Python package has started this process, end with it, also if a signal kills only the command.

void end_with_command()
{
#ifdef __linux__
  const char *command = getenv("FIX_NOSQUISH_COMMAND");
  if (command && std::to_string(getppid()) == command) prctl(PR_SET_PDEATHSIG, SIGTERM);
#endif
}

// The Python that has this package, from the environment: EXECUTABLE:LIBRARY:VERSION.

struct Interpreter {
  std::string executable, libpython, version;

  Interpreter()
  {
    const char *setting = getenv("FIX_NOSQUISH_PYTHON");
    std::istringstream words(setting ? setting : "");
    for (auto part : {&executable, &libpython, &version}) std::getline(words, *part, ':');
  }

  // a message if the Python in this process has another version
  std::string unlike() const
  {
    const std::string full = symbol<const char *()>("Py_GetVersion")();
    const auto there = full.substr(0, full.find('.', full.find('.') + 1));
    if (version.empty() || there == version) return "";
    return "this LAMMPS has Python " + there + " inside, and " + executable + " is Python " + version +
        ": install fix_nosquish for a Python " + there;
  }

  void name_program() const    // finds the packages of its venv
  {
    const auto name = symbol<wchar_t *(const char *, size_t *)>("Py_DecodeLocale")(executable.c_str(), nullptr);
    symbol<void(const wchar_t *)>("Py_SetProgramName")(name);
  }
};

bool python_is_there()    // also if LAMMPS was built with the package PYTHON, and it does not run yet
{
  return symbol<int()>("Py_IsInitialized");
}

bool python_runs()
{
  return python_is_there() && symbol<int()>("Py_IsInitialized")();
}

// Run a line of Python, on any thread.

void run_python(const std::string &line)
{
  auto state = symbol<int()>("PyGILState_Ensure")();
  symbol<int(const char *)>("PyRun_SimpleString")(line.c_str());
  symbol<void(int)>("PyGILState_Release")(state);
}

// Have LAMMPS's command python, if it starts Python, use the packages of the same virtual environment.

void name_python_early()
{
  const Interpreter python;
  if (python_is_there() && !python_runs() && !python.executable.empty() && python.unlike().empty()) python.name_program();
}

// Start Python in this process unless it runs; returns a message if that is impossible. A native lmp has no Python, or that of the
// package PYTHON. The command lmp, a Python script, names its interpreter and library in the environment.

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
  if (!python_is_there()) {
    if (python.libpython.empty())
      return "the Python " + python.executable + " has no shared libpython" + instead;
    if (!dlopen(python.libpython.c_str(), RTLD_NOW | RTLD_GLOBAL)) return dlerror() + instead;
  }
  const auto unlike = python.unlike();
  if (!unlike.empty()) return unlike;

  python.name_program();
  // This thread keeps the GIL, because a LAMMPS with the package PYTHON finalizes Python as if it had it.
  symbol<void(int)>("Py_InitializeEx")(0);
  // Ctrl-C ends LAMMPS at once, as without Python, also after a class imports the module signal.
  run_python("import signal as s\n"
             "if s.getsignal(s.SIGINT) is s.default_int_handler: s.signal(s.SIGINT, s.SIG_DFL)\n"
             "del s");
  // A native lmp does not finalize this interpreter, so its buffers must not keep anything.
  run_python("__import__('sys').stdout.reconfigure(line_buffering=True)");
  return "";
}

}    // namespace nosquish
}    // namespace

#endif
