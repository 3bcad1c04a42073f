// What the harness sees and steers while LAMMPS runs a user's script: each command as LAMMPS
// executes it, after substitution, and each file that LAMMPS opens.  The library is preloaded
// (LD_PRELOAD), so that these definitions come before those of LAMMPS and libc.  See recorder.py.

#include "fix.h"
#include "input.h"
#include "lammps.h"
#include "modify.h"
#include "platform.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <fcntl.h>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>

// without std::filesystem, whose symbols older systems do not have
using namespace LAMMPS_NS;

namespace {

const std::string ALIAS = "/validation-out";    // of the output folder, in commands
enum { DO, LEAVE_OUT, STOP };                   // what the harness answers to a command
using Answer = int (*)(const char *command, int number, char **words, int at_once);

Answer answer = nullptr;
bool active = false;              // whether overlays are in use: LAMMPS works in this process
bool within = false;              // whether it is within a command, and not between two
std::string out;                  // the output folder
std::vector<std::string> overlays;    // each stands for /; files are written to the first only
std::set<std::string> looked;     // the user's files that were looked for
std::string rest;                 // lines behind the command at which the script was stopped

template <class Function> Function *original(const char *name)
{
  return reinterpret_cast<Function *>(dlsym(RTLD_NEXT, name));
}

bool below(const std::string &path, const std::string &folder)
{
  return path.compare(0, folder.size() + 1, folder + "/") == 0;
}

bool exists(const std::string &path, mode_t kind = 0)
{
  struct stat found;
  return stat(path.c_str(), &found) == 0 && (!kind || (found.st_mode & S_IFMT) == kind);
}

// An absolute name without . and .., as it is written: links are not followed.
std::string normal(const std::string &name)
{
  std::string whole = name, made;
  if (!name.empty() && name[0] != '/') {
    char *here = getcwd(nullptr, 0);    // none in a folder that is gone
    whole = std::string(here ? here : "") + "/" + name;
    free(here);
  }
  std::istringstream parts(whole);
  for (std::string part; std::getline(parts, part, '/');)
    if (part == "..")
      made.erase(std::min(made.rfind('/'), made.size()));
    else if (!part.empty() && part != ".")
      made += "/" + part;
  return made.empty() && !name.empty() ? "/" : made;
}

// Where a file is in the user's folders, if relative names are those of an overlay, too.
std::string users(const char *name)
{
  const std::string path = normal(name);
  for (const auto &overlay : overlays)
    if (below(path, overlay)) return path.substr(overlay.size());
  return path;
}

// Where a file is that is read.
std::string to_read(const char *name)
{
  const std::string path = users(name);
  if (below(path, ALIAS)) return out + path.substr(ALIAS.size());
  for (const auto &overlay : overlays)
    if (exists(overlay + path)) return overlay + path;
  looked.insert(path);
  return exists(name) ? name : path;    // as links have it
}

// Where a file is to be written.
std::string to_write(const char *name, bool keeps)
{
  const std::string path = users(name);
  if (below(path, ALIAS)) return out + path.substr(ALIAS.size());
  if (below(path, "/dev")) return path;
  const std::string place = overlays.front() + path;
  const std::string folder = path.substr(0, path.rfind('/') + 1);
  if (exists(to_read(folder.c_str()), S_IFDIR))
    for (auto end = place.find('/', 1); end != std::string::npos; end = place.find('/', end + 1))
      mkdir(place.substr(0, end).c_str(), 0777);
  if (keeps && !exists(place)) {
    const std::string source = to_read(name);
    if (exists(source, S_IFREG))
      std::ofstream(place, std::ios::binary) << std::ifstream(source, std::ios::binary).rdbuf();
  }
  return place;
}

// Whether LAMMPS calls, or a library that its Python package brings, and not Python itself. LAMMPS
// calls by std::filesystem, too.
bool from_lammps(void *caller)
{
  Dl_info info;
  if (!active || !dladdr(caller, &info)) return false;
  for (const char *name : {"liblammps", "/lammps.libs/", "/libstdc++"})
    if (strstr(info.dli_fname, name)) return true;
  return false;
}

struct Begin {
  Begin()
  {
    const char *told = getenv("VALIDATION_OVERLAYS");
    std::istringstream lines(told ? told : "");
    std::getline(lines, out);
    for (std::string overlay; std::getline(lines, overlay);) overlays.push_back(overlay);
  }
} begin;
}    // namespace

int Input::execute_command()
{
  static const auto execute = original<int(Input *)>("_ZN9LAMMPS_NS5Input15execute_commandEv");
  active = !overlays.empty();
  const int told = answer ? answer(command, narg, arg, command_map->count(command) > 0) : DO;
  if (told == LEAVE_OUT) return 0;
  if (told == DO) {
    within = true;
    const int unknown = execute(this);
    within = false;
    return unknown;
  }
  rest.clear();
  char line[256];
  while (me == 0 && infile && fgets(line, sizeof line, infile)) rest += line;
  return 1;    // LAMMPS raises an error
}

// The names in a folder, among which LAMMPS looks for a pattern: the user's, and those of overlays.
std::vector<std::string> platform::list_directory(const std::string &folder)
{
  static const auto list = original<std::vector<std::string>(const std::string &)>(
      "_ZN9LAMMPS_NS8platform14list_directoryERKNSt7__cxx1112basic_stringIcSt11char_traitsIcESaIcEEE");
  if (!active) return list(folder);
  const std::string path = users(folder.c_str());
  std::set<std::string> found;
  for (const auto &place : overlays)
    for (const auto &name : list(place + path)) found.insert(name);
  for (const auto &name : list(path)) found.insert(name);
  return {found.begin(), found.end()};
}

extern "C" {

void recorder_see(Answer given)
{
  answer = given;
  active = !overlays.empty();
}

int recorder_within()
{
  return within;
}

const char *recorder_rest()
{
  return rest.c_str();
}

const char *recorder_looked()
{
  static std::string told;
  told.clear();
  for (const auto &file : looked) told += file + "\n";
  return told.c_str();
}

// Keep what a fix remembers out of restart files; and, if it is to rest, its hands off the atoms.
void recorder_forget(LAMMPS *lammps, const char *id, int rests)
{
  for (int i = 0; i < lammps->modify->nfix; i++) {
    if (strcmp(lammps->modify->fix[i]->id, id)) continue;
    lammps->modify->fix[i]->restart_global = lammps->modify->fix[i]->restart_peratom = 0;
    if (rests) lammps->modify->fix[i]->groupbit = 0;
  }
}

FILE *fopen(const char *name, const char *mode)
{
  static const auto open = original<FILE *(const char *, const char *)>("fopen");
  const bool writes = mode[0] != 'r' || strchr(mode, '+');
  if (overlays.empty() || (!active && !below(name, ALIAS))) return open(name, mode);
  FILE *file = open((writes ? to_write(name, mode[0] != 'w') : to_read(name)).c_str(), mode);
  // by whose growth the harness sees that a run is alive
  if (file && writes && ALIAS + "/script/log.lammps" == name) setvbuf(file, nullptr, _IOLBF, BUFSIZ);
  return file;
}

FILE *fopen64(const char *name, const char *mode)
{
  return fopen(name, mode);
}

int open(const char *name, int flags, ...)
{
  static const auto open = original<int(const char *, int, ...)>("open");
  va_list more;
  va_start(more, flags);
  const mode_t mode = flags & O_CREAT ? va_arg(more, mode_t) : 0;
  va_end(more);
  if (!from_lammps(__builtin_return_address(0))) return open(name, flags, mode);
  const bool writes = flags & (O_WRONLY | O_RDWR);
  const std::string place = writes ? to_write(name, !(flags & O_TRUNC)) : to_read(name);
  return open(place.c_str(), flags, mode);
}

FILE *popen(const char *command, const char *mode)
{
  static const auto open = original<FILE *(const char *, const char *)>("popen");
  if (!from_lammps(__builtin_return_address(0))) return open(command, mode);
  std::string line = command;    // of a compressed file: gzip > "name", gzip -cdf "name"
  const auto end = line.rfind('"'), begin = line.find('"') + 1;
  if (begin == 0 || begin > end) return mode[0] == 'w' ? nullptr : open(command, mode);
  const std::string name = line.substr(begin, end - begin);
  line.replace(begin, end - begin, mode[0] == 'w' ? to_write(name.c_str(), false) : to_read(name.c_str()));
  return open(line.c_str(), mode);
}

int chdir(const char *name) noexcept
{
  static const auto change = original<int(const char *)>("chdir");
  return change(from_lammps(__builtin_return_address(0)) ? to_read(name).c_str() : name);
}

int mkdir(const char *name, mode_t mode) noexcept
{
  static const auto make = original<int(const char *, mode_t)>("mkdir");
  const bool ours = from_lammps(__builtin_return_address(0));
  return make(ours ? to_write(name, false).c_str() : name, mode);
}

int rename(const char *name, const char *other) noexcept
{
  static const auto move = original<int(const char *, const char *)>("rename");
  if (!from_lammps(__builtin_return_address(0))) return move(name, other);
  return move(to_write(name, true).c_str(), to_write(other, false).c_str());
}

int unlink(const char *name) noexcept
{
  static const auto remove = original<int(const char *)>("unlink");
  return remove(from_lammps(__builtin_return_address(0)) ? to_write(name, false).c_str() : name);
}

int remove(const char *name) noexcept
{
  static const auto remove = original<int(const char *)>("remove");
  return remove(from_lammps(__builtin_return_address(0)) ? to_write(name, false).c_str() : name);
}
}
