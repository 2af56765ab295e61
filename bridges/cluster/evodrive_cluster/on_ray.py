"""Shards as Ray tasks. Machines share nothing: the study and the binary go to each of them once, results come back through Ray or
through the place of results."""

import json
import os
import sys

from .bundle import digest_of, unpacked
from .conduct import Event, carry_out, parsed, resumed
from .place import place
from .work import Busy, Lacking, Lost, Refused, do_shard

try:
    import ray
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy
except ImportError:
    ray = None

SECONDS = 1.0


def on_a_worker(name, shard, bundle, digest, installed, jobs, results, questions):
    """What a task does: the result, or nothing where it lies at the place of results."""
    here = os.environ.get("EVODRIVE_NODE") or ray.get_runtime_context().get_node_id()
    os.environ["EVODRIVE_NODE"] = here
    # Fetched from the object store where this machine has not got it yet.
    try:
        folder = unpacked(digest, lambda: ray.get(bundle[0]))
    except PermissionError as refused:
        return "lacking", here, str(refused), None, ()
    command = [installed] if installed else [str(folder / "evodrive")]
    try:
        content, said, spent = do_shard(name, shard, folder, command, jobs, questions)
    except (Lost, Busy, Lacking, Refused) as ended:
        # Ray would wrap an exception, and a class of a driver's module need not be on the worker.
        return type(ended).__name__.lower(), here, str(ended), None, ()
    if results:
        place(results).write(name.removesuffix(".shard") + ".result", content)
        content = None
    return "done", here, said, content, spent


class Ray:
    """The crew."""

    @staticmethod
    def room(options):
        """How many shards can be under way at once."""
        begin(options)
        if options.workers is not None:
            return options.workers
        return max(1, int(ray.cluster_resources().get("CPU", 1) // options.cpus))

    def __init__(self, options, files, _shards):
        begin(options)
        self.options, self.digest = options, digest_of(files)
        self.bundle = ray.put(files)
        resources = json.loads(options.resources)
        # Tries are counted by the driver and not by Ray, so that a shard that is refused is not sent again.
        self.task = ray.remote(num_cpus=options.cpus, resources=resources, max_retries=0)(on_a_worker)
        self.under_way = {}
        self.alone = False

    def at_once(self):
        # Ray scales by what waits: without a limit everything does.
        return self.options.workers or sys.maxsize

    def submit(self, shard, _number, avoid):
        options = self.options
        how = {"name": shard.name}
        if avoid:
            others = [of["NodeID"] for of in ray.nodes() if of["Alive"] and of["NodeID"] not in avoid and of["Resources"].get("CPU")]
            if others:
                how["scheduling_strategy"] = NodeAffinitySchedulingStrategy(others[0], soft=True)
        task = self.task.options(**how)
        # In a list an object is not fetched before the task asks for it.
        reference = task.remote(shard.path.name, shard.path.read_bytes(), [self.bundle], self.digest, options.installed, options.cpus,
                                options.results, options.open)
        self.under_way[reference] = shard

    def wait(self):
        ready, _ = ray.wait(list(self.under_way), num_returns=1, timeout=SECONDS)
        alone = not ready and not self.has_others(set())
        if alone and not self.alone:
            print("no machine of the cluster has CPUs; waiting for one", file=sys.stderr)
        self.alone = alone
        for reference in ready:
            shard = self.under_way.pop(reference)
            try:
                kind, where, said, content, spent = ray.get(reference)
                yield Event(shard, kind, where, said, content, *spent)
            except ray.exceptions.RayTaskError as failed:
                # The task itself failed, not evodrive: a full disk, a package that is missing.
                yield Event(shard, "lost", "", str(failed))
            except ray.exceptions.RayError as lost:
                yield Event(shard, "lost", "", f"{type(lost).__name__}: {lost}")

    def has_others(self, avoid):
        return any(of["Alive"] and of["NodeID"] not in avoid and of["Resources"].get("CPU") for of in ray.nodes())

    def close(self):
        for reference in self.under_way:
            ray.cancel(reference, force=True)
        self.under_way = {}


def begin(options):
    if ray.is_initialized():
        return
    # A Ray of its own needs no dashboard.
    own = {"include_dashboard": False} if options.address is None else {}
    # Workers need Ray and no package of ours.
    ray.cloudpickle.register_pickle_by_value(sys.modules[__package__])
    ray.init(address=options.address or "local", log_to_driver=False, configure_logging=False, **own)


def more(parser):
    parser.add_argument("--address", help="of a Ray cluster (auto, ray://head:10001); without it Ray is started on this machine")
    parser.add_argument("--resources", default="{}", help='further resources of a shard as JSON, e.g. {"metadrive": 1}')


def main():
    options = resumed(parsed("evodrive-ray", __doc__, more))
    if ray is None:
        sys.exit("evodrive-ray needs Ray: pip install 'evodrive-cluster[ray]'")
    sys.exit(carry_out(options, Ray))


if __name__ == "__main__":
    main()
