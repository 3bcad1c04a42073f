# make runs of the water of in.speed for GROMACS, at 2 and 4 fs, in a folder: sh gromacs.sh FOLDER
#
# gmx mdrun -s FOLDER/2.tpr -deffnm FOLDER/2 -ntmpi 1 -ntomp 1 -nb cpu
set -e
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1" && cd "$1"

# molecules that overlap at the faces of the box are moved apart
gmx solvate -cs spc216.gro -box 3.1043 -scale 0.55 -maxsol 1000 -o water.gro
(cat "$here/gromacs.mdp"; echo "integrator = steep") > steep.mdp
gmx grompp -f steep.mdp -c water.gro -p "$here/gromacs.top" -o steep.tpr
gmx mdrun -s steep.tpr -deffnm steep -ntmpi 1 -ntomp 1 -nb cpu -nsteps 300

for dt in 2 4; do
    (
        cat "$here/gromacs.mdp"
        echo "dt = 0.00$dt"
        printf "%s\n" "tcoupl = v-rescale" "tc-grps = System" "tau-t = 0.2" "ref-t = 295"
        printf "%s\n" "gen-vel = yes" "gen-temp = 295"
    ) > $dt.mdp
    gmx grompp -f $dt.mdp -c steep.gro -p "$here/gromacs.top" -o $dt.tpr
done
