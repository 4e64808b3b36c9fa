"""Warp kernels: device functions, structs and kernels only, one file per piece of physics.

Positions and energies are float64. Every kernel gathers: a thread writes its own element only, so that results do not
depend on the order of threads, and a CPU run repeats bit for bit. `first` shifts the thread index so that a range of
elements can be launched on its own.
"""
