"""Scripts in which molecules come and go."""

# Its centre is its centre of mass, at the origin: fix gcmc puts bodies of fix rigid/small elsewhere
# than their atoms if not.
MOLECULE = """bent

3 atoms

Coords

1 -0.3 -0.4 -0.1
2 0.8 -0.2 -0.1
3 -0.5 0.6 0.2

Types

1 1
2 2
3 2
"""
SCRIPT = """units lj
atom_style {style}
boundary p p p
region box block 0 {edge} 0 {edge} 0 {edge}
create_box 2 box
{masses}
molecule bent mol.bent
pair_style lj/cut 2.5
pair_coeff * * 0.4 0.8
neigh_modify delay 0 every 1 check yes exclude molecule/intra all
region inner block 1.5 7 1.5 7 1.5 7
{first}
group mols type 1 2
timestep 0.002
{fix}
{changes}
compute_modify thermo_temp dynamic/dof yes
thermo 20
thermo_style custom step atoms temp pe etotal
thermo_modify format float %.15g lost error
{run}
write_dump all custom end id mol type x y z vx vy vz modify sort id format float %.17g
"""
MASSES = "mass 1 1.0\nmass 2 1.0"
MOLECULES = (
    "create_atoms 0 random {} 4928 inner overlap 1.2 maxtry 1000 mol bent 777\n"
    "velocity all create 1.0 4711 loop geom"
)
THEIRS = "fix 1 mols rigid/nve/small molecule mol bent"
OURS = "fix 1 mols nosquish/nve molecule mol bent order 123"
DEPOSIT = (
    "fix 2 mols deposit 12 0 8 4567 region box near 1.0 vx -1 1 vy -1 1 vz -1 1 mol bent rigid 1"
    " units box"
)
GCMC = "fix 2 mols gcmc 20 12 0 0 29494 1.0 {} 0.5 mol bent rigid 1 group mols tfac_insert 2"
EVAPORATE = "fix 3 mols evaporate 10 3 box 4928 molecule yes"
