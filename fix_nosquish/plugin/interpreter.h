/* Python in this process: found, or started. Of Python itself a few functions are called, looked up by name at run time, so that one
   compiled plugin serves every Python version. */

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

// The lmp command that started this native lmp only waits for it. A signal that ends the command alone would leave this process
// behind, so Linux is asked to end it, too. Another parent may end without that.

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

bool python_is_there()    // it runs, or LAMMPS was built with its package PYTHON
{
  return symbol<int()>("Py_IsInitialized");
}

bool python_runs()
{
  return python_is_there() && symbol<int()>("Py_IsInitialized")();
}

// Run a line of Python, whichever thread this is.

void run_python(const std::string &line)
{
  auto state = symbol<int()>("PyGILState_Ensure")();
  symbol<int(const char *)>("PyRun_SimpleString")(line.c_str());
  symbol<void(int)>("PyGILState_Release")(state);
}

// LAMMPS's command python may be the first that needs Python. It then has the packages of the same virtual environment.

void name_python_early()
{
  const Interpreter python;
  if (python_is_there() && !python_runs() && !python.executable.empty() && python.unlike().empty()) python.name_program();
}

// Make sure that Python runs in this process, and return what prevents it, or nothing. A native lmp has no Python, or the one of
// LAMMPS's package PYTHON. The lmp command, which is a Python script, names its interpreter and its library in the environment.

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
  // This thread keeps Python's lock: a LAMMPS with the package PYTHON ends Python as one that has it.
  symbol<void(int)>("Py_InitializeEx")(0);
  // Ctrl-C ends LAMMPS at once, as it does without Python. The module signal would change that when a class imports it.
  run_python("import signal as s\n"
             "if s.getsignal(s.SIGINT) is s.default_int_handler: s.signal(s.SIGINT, s.SIG_DFL)\n"
             "del s");
  // Nothing ends this interpreter in a native lmp, so nothing may wait in its buffers.
  run_python("__import__('sys').stdout.reconfigure(line_buffering=True)");
  return "";
}

}    // namespace nosquish
}    // namespace

#endif
