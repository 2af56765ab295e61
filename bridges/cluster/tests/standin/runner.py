"""The tasks of one array of the stand-in for Slurm: one at a time a node, whoever's they are, and so many at once as the array allows."""

import fcntl
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

job, tasks, limit, cpus, nodes, words = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4], sys.argv[5].split(), sys.argv[6:]
waiting = list(range(tasks))
lock = threading.Lock()
at_once = threading.Semaphore(limit)


def work(node):
    while waiting:
        # A task that its array holds back keeps no node from others, and one whose node has work keeps no place in its array.
        with at_once, (job.parent.parent / f"node-{node}").open("w") as busy:
            try:
                fcntl.flock(busy, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                place = None
            else:
                with lock:
                    place = waiting.pop(0) if waiting else None
                if place is not None:
                    run(place, node)
        if place is None:
            time.sleep(0.05)


def run(place, node):
    state = job / str(place)
    if not state.exists():
        return
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
