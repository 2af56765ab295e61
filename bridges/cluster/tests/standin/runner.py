"""The tasks of one array of the stand-in for Slurm: one at a time a node."""

import os
import subprocess
import sys
import threading
from pathlib import Path

job, tasks, cpus, nodes, words = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3], sys.argv[4].split(), sys.argv[5:]
waiting = list(range(tasks))
lock = threading.Lock()


def work(node):
    while True:
        with lock:
            if not waiting:
                return
            place = waiting.pop(0)
        state = job / str(place)
        if not state.exists():
            continue
        own = {"SLURM_ARRAY_JOB_ID": job.name, "SLURM_ARRAY_TASK_ID": str(place), "SLURM_JOB_ID": f"{job.name}{place:04}",
               "SLURM_CPUS_PER_TASK": cpus, "SLURMD_NODENAME": node, "EVODRIVE_CACHE": str(job.parent.parent / f"cache-{node}")}
        task = subprocess.Popen(["bash", *words], env={**os.environ, **own}, start_new_session=True)
        state.write_text(str(task.pid))
        task.wait()
        state.unlink(missing_ok=True)


threads = [threading.Thread(target=work, args=(node,)) for node in nodes]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
