# make runs of the water of in.speed for GROMACS, at 2 and 4 fs, and with hydrogens of 3.024 amu
# at 6 and 8 fs, in a folder: sh gromacs.sh FOLDER
#
# gmx mdrun -s FOLDER/water-2.tpr -deffnm FOLDER/water-2 -ntmpi 1 -ntomp 1 -nb cpu
set -e
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1" && cd "$1"

# molecules that overlap at the faces of the box are moved apart; repeat this if mdrun fails: they differ each time
gmx solvate -cs spc216.gro -box 3.1043 -scale 0.55 -maxsol 1000 -o water.gro
(cat "$here/gromacs.mdp"; echo "integrator = steep") > steep.mdp
gmx grompp -f steep.mdp -c water.gro -p "$here/gromacs.top" -o steep.tpr -pp water.top
sed -E "/ OW +1 +-0.834/s/$/ 11.9674/; / HW[12] +1 +0.417/s/$/ 3.024/" water.top > heavy.top
gmx mdrun -s steep.tpr -deffnm steep -ntmpi 1 -ntomp 1 -nb cpu -nsteps 300

make() { # TOPOLOGY STEP
    (
        cat "$here/gromacs.mdp"
        echo "dt = 0.00$2"
        printf "%s\n" "tcoupl = v-rescale" "tc-grps = System" "tau-t = 0.2" "ref-t = 295"
        printf "%s\n" "gen-vel = yes" "gen-temp = 295"
    ) > $1-$2.mdp
    gmx grompp -f $1-$2.mdp -c steep.gro -p $1.top -o $1-$2.tpr
}
make water 2
make water 4
make heavy 6
make heavy 8
