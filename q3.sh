. /work/scratch/hands/env.sh
for s in 300 301; do for r in g1 hrp4_class talos; do timeout 900 nice -n 5 python /work/scratch/hands/trace.py /work/scratch/hands/$r.door$s.pkl door --robot $r --mode torque --seed $s > /work/scratch/hands/$r.door$s.log 2>&1; done; done
