"""`tessera verify` accepts the file, and refuses it after one voxel was changed."""

import numpy
import pyopenvdb


def check_verify(rng, tessera, mesh_path, vdb_path, changed_path, file, samples):
    """Problems, and what was changed in the file at `changed_path` (empty: nothing could be)."""
    result = tessera("verify", mesh_path, vdb_path, "--quiet")
    if result.returncode != 0:
        return [f"verify: exit code {result.returncode} for an untouched file: {result.stderr.strip()}"], ""
    what = change_coverage(rng, file, samples) if rng.random() < 0.4 else change_value(rng, file, samples)
    if not what:
        return [], ""
    pyopenvdb.write(str(changed_path), grids=[g.vdb for g in file.grids.values()], metadata=file.metadata)
    result = tessera("verify", mesh_path, changed_path, "--quiet")
    if result.returncode == 2:
        return [], what
    return [f"verify: exit code {result.returncode}, not 2, after {what}: {result.stderr.strip()}"], what


def change_value(rng, file, samples):
    """Changes a random active voxel of a value grid by a third of the field's range or more."""
    grids = [
        (file.grid(name, level), i) for level in file.levels() for i, field in enumerate(file.fields) for name in field["grids"]
        if file.grid(name, level) is not None and len(file.grid(name, level).points)
    ]  # fmt: skip
    if not grids:
        return ""
    grid, position = grids[int(rng.integers(len(grids)))]
    row = int(rng.integers(len(grid.points)))
    point, component = tuple(int(x) for x in grid.points[row]), int(rng.integers(grid.components))
    channels = slice(samples.table.first[position], samples.table.first[position + 1])
    span = (samples.table.highest[:, channels].max() - samples.table.lowest[:, channels].min()) or 1.0
    accessor = grid.vdb.getAccessor()
    value = numpy.atleast_1d(numpy.array(accessor.getValue(point), float))
    step = max(span * 0.3, 0.1 * abs(value[component]))
    changed = value.copy()
    # Towards zero where that is possible, so that half floats don't overflow.
    changed[component] += -step if value[component] > 0 else step
    accessor.setValueOn(point, tuple(changed) if grid.components == 3 else float(changed[0]))
    covered = file.grid("coverage", grid.level).find(numpy.array([point]))[0] >= 0
    return f"{grid.name} at {point} ({'a sample' if covered else 'an extension'}) was set from {value} to {changed}"


def change_coverage(rng, file, samples):
    """Switches off the coverage of a point well inside the mesh, or on that of an extension voxel."""
    grids = [file.grid("coverage", level) for level in file.levels()]
    grids = [g for g in grids if g is not None and len(g.points)]
    if not grids:
        return ""
    grid = grids[int(rng.integers(len(grids)))]
    accessor = grid.vdb.getAccessor()
    values, _, _, _ = next(file.channel_grids(grid.level))
    extension = values.points[grid.find(values.points) < 0] if values is not None else numpy.zeros((0, 3), int)
    on = len(extension) and rng.random() < 0.4
    candidates = extension if on else grid.points
    candidates = candidates[rng.permutation(len(candidates))[:20]]
    distance, _ = samples.level(grid.level).nearest(candidates)
    if on:
        # Points with a value that isn't finite are in the mesh too.
        distance[samples.states(grid.level, candidates) >= 0] = 0
    candidates = candidates[distance > 0.01]
    if not len(candidates):
        return ""
    point = tuple(int(x) for x in candidates[0])
    if on:
        accessor.setValueOn(point, True)
    else:
        accessor.setValueOff(point, False)
    return f"{grid.name} was switched {'on' if on else 'off'} at {point}"
