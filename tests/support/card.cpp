/* Fixes nve/card/before and nve/card/after, for tests: what the fix with ID ours, between them, changes on the host, beside what it
   tells KOKKOS, in any LAMMPS. The names are those of fixes that read no velocities, so that the fix does not take them for readers.
   The scalar is how many changes of an array there were that it had told. */

#include "atom.h"
#include "error.h"
#include "fix.h"
#include "lammps.h"
#include "modify.h"
#include "pointers.h"

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

using namespace LAMMPS_NS;

struct Array {
  const char *name;
  uint64_t bit;    // in LAMMPS's atom_masks.h
  void *place;
  size_t bytes;
  std::vector<char> content;
};

std::vector<Array> kept;
int told;

class Card : public Fix {
 public:
  const bool before;

  Card(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg), before(strstr(arg[2], "before"))
  {
    scalar_flag = 1;
    extscalar = 0;
  }
  int setmask() override
  {
    using namespace FixConst;
    return INITIAL_INTEGRATE | PRE_EXCHANGE | POST_NEIGHBOR | PRE_REVERSE | POST_FORCE | FINAL_INTEGRATE | END_OF_STEP;
  }
  void setup(int) override { look(); }
  void initial_integrate(int) override { look(); }
  void pre_exchange() override { look(); }
  void post_neighbor() override { look(); }
  void pre_reverse(int, int) override { look(); }
  void post_force(int) override { look(); }
  void final_integrate() override { look(); }
  void end_of_step() override { look(); }
  double compute_scalar() override { return told; }

 private:
  void keep()
  {
    const size_t n = atom->nlocal, vector = 3 * sizeof(double);
    const bool renumbered = lmp->num_ver > 20250722;
    auto either = [=](int before, int after) { return 1ULL << (renumbered ? after : before); };
    auto rows = [](double **array) { return array ? array[0] : nullptr; };
    kept = {{"x", 0x1, rows(atom->x), vector * n}, {"v", 0x2, rows(atom->v), vector * n}, {"f", 0x4, rows(atom->f), vector * n},
            {"tag", 0x8, atom->tag, sizeof(tagint) * n}, {"type", 0x10, atom->type, sizeof(int) * n},
            {"mask", 0x20, atom->mask, sizeof(int) * n}, {"image", 0x40, atom->image, sizeof(imageint) * n},
            {"q", 0x80, atom->q, sizeof(double) * n}, {"molecule", 0x100, atom->molecule, sizeof(tagint) * n},
            {"rmass", 0x200, atom->rmass, sizeof(double) * n}, {"radius", either(20, 34), atom->radius, sizeof(double) * n},
            {"omega", either(22, 35), rows(atom->omega), vector * n}, {"torque", either(23, 36), rows(atom->torque), vector * n}};
    for (auto &array : kept)
      if (const auto *begin = static_cast<char *>(array.place)) array.content.assign(begin, begin + array.bytes);
  }

  void look()
  {
    const Fix *ours = modify->get_fix_by_id("ours");
    if (~ours->datamask_read || ours->execution_space != Host) error->all(FLERR, "fix ours does not have all that it may read");
    if (before) return keep();
    for (const auto &array : kept) {
      const bool same = array.content.empty() || !memcmp(array.place, array.content.data(), array.bytes);
      if (!same && !(ours->datamask_modify & array.bit)) error->one(FLERR, std::string("fix ours has changed array ") + array.name);
      told += !same;
    }
  }
};

extern "C" void lammpsplugin_init(void *pointer, void *handle, void *enter)
{
  struct {
    const char *version, *style, *name, *info, *author;
    void *(*creator)(void *, int, char **);
    void *handle;
  } plugin{static_cast<LAMMPS *>(pointer)->version, "fix", "", "what KOKKOS is told", "tests",
           [](void *lmp, int narg, char **arg) -> void * {
             return static_cast<Fix *>(new Card(static_cast<LAMMPS *>(lmp), narg, arg));
           },
           handle};
  for (const char *name : {"nve/card/before", "nve/card/after"}) {
    plugin.name = name;
    reinterpret_cast<void (*)(void *, void *)>(enter)(&plugin, pointer);
  }
}
