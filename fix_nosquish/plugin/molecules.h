/* Molecules that other fixes insert as rigid bodies: keyword mol. */

#ifndef FIX_NOSQUISH_MOLECULES_H
#define FIX_NOSQUISH_MOLECULES_H

#include "part.h"
#include "templates.h"

#include "atom.h"

#include <vector>

namespace {
namespace nosquish {

class Molecules : public Part {
 public:
  using Part::Part;

  // The first of the molecules of the template; null if there is no template.

  Molecule **first() const
  {
    const int number = bridge.template_id ? atom->find_molecule(bridge.template_id) : -1;
    return number < 0 ? nullptr : atom->molecules + number;
  }

  bool describe(int number, double *numbers) const { return first() && Templates::read(atom, first()[number], numbers); }

  // Another fix has inserted a molecule, on all ranks with those of its atoms that belong there. What does not follow from its atoms is
  // kept until Python makes the body.

  void add(int before, tagint tag, int number, const double *velocity, const double *quat)
  {
    inserted.resize(NUMBERS * bridge.insertions++);    // Python sets insertions to 0
    inserted.insert(inserted.end(), {(double) tag, (double) (atom->nlocal - before), (double) number});
    inserted.insert(inserted.end(), velocity, velocity + 3);
    inserted.insert(inserted.end(), quat, quat + 4);
    bridge.inserted = inserted.data();
  }

 private:
  static constexpr int NUMBERS = 10;    // of each molecule
  std::vector<double> inserted;
};

}    // namespace nosquish
}    // namespace

#endif
