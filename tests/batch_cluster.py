"""A real Dask cluster of two worker processes on this machine: prints its address, then waits.

python batch_cluster.py [WORKERS]
"""

from __future__ import annotations

import sys

if __name__ == "__main__":
    import distributed

    with distributed.LocalCluster(
        n_workers=int(sys.argv[1]) if len(sys.argv) > 1 else 2,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,
        silence_logs=50,
    ) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
