"""Draws the options of `tessera resample` for a mesh."""

import numpy


def choose(rng, choices):
    """choices: (weight, value) pairs."""
    weights = numpy.array([w for w, _ in choices], float)
    return choices[int(rng.choice(len(choices), p=weights / weights.sum()))][1]


def draw_bounds(rng, mesh, spacing):
    """A box that meets the mesh's box, mostly around an element: partly outside, on lattice planes, thin or tiny."""
    low, high = mesh.bounds()
    size = high - low
    middle = mesh.points[mesh.tets[rng.integers(len(mesh.tets))]].mean(axis=0)
    kind = str(rng.choice(["random", "aligned", "thin", "tiny", "generous"], p=[0.4, 0.2, 0.15, 0.1, 0.15]))
    half = size * rng.uniform(0.1, 0.7, 3)
    a, b = middle - half * rng.uniform(0.2, 1, 3), middle + half * rng.uniform(0.2, 1, 3)
    if kind == "aligned":
        a = low + spacing * numpy.floor((a - low) / spacing)
        b = a + spacing * numpy.maximum(1, numpy.round((b - a) / spacing))
    elif kind == "thin":
        axis = rng.integers(3)
        a[axis], b[axis] = middle[axis] - size[axis] * 0.01, middle[axis] + size[axis] * 0.01
    elif kind == "tiny":
        a, b = middle - size.max() * rng.uniform(0.01, 0.05), middle + size.max() * rng.uniform(0.01, 0.05)
    elif kind == "generous":
        a, b = low - size.max() * rng.uniform(0.05, 0.3, 3), high + size.max() * rng.uniform(0.05, 0.3, 3)
    return kind, a, b


def draw_options(rng, mesh, algorithms):
    """The arguments after the names of the files, and words for the summary."""
    low, high = mesh.bounds()
    longest = float((high - low).max())
    arguments, features = [], set()

    def use(*words):
        arguments.extend(str(w) for w in words)

    refine = choose(rng, [(2, "uniform"), (3, "element-size"), (4, "error")])
    features.add(refine)
    use("--refine", refine)
    brick_size = choose(rng, [(3, 8), (1, 16)])
    use("--brick-size", brick_size)
    features.add(f"bricks of {brick_size}")
    resolution = int(choose(rng, [(4, rng.integers(8, 20)), (2, rng.integers(20, 34)), (1, rng.integers(34, 49))]))
    spacing = longest / (resolution - 1)
    if refine == "uniform":
        if rng.random() < 0.3:
            spacing *= rng.uniform(0.9, 1.1)
            use("--spacing", repr(spacing))
        else:
            use("--resolution", resolution)
    elif refine == "element-size":
        use("--samples-per-element", round(float(rng.uniform(1, 10) if brick_size == 8 else rng.uniform(1, 16)), 2), "--max-levels", choose(rng, [(1, 1), (3, 2), (3, 3), (2, 5)]))
    else:
        use("--max-error", f"{float(10 ** rng.uniform(-0.9, 1.2)):.2g}%", "--error-measure", choose(rng, [(2, "max"), (1, "rms")]))
        if rng.random() < 0.5:
            use("--max-levels", rng.integers(2, 6))
        if all(field.location == "cell" for field in mesh.fields):
            use("--error-field", mesh.fields[0].name)
    if refine != "uniform" and rng.random() < 0.25:
        # Two levels begin at 63 points for bricks of 8 cells, at 127 for others.
        spacing = longest / (rng.uniform(64, 160) * brick_size / 8)
        use("--spacing", repr(spacing))
        features.add("adaptive with finest spacing")
    layout = choose(rng, [(1, "levels"), (1, "flat")])
    use("--layout", layout)
    features.add(layout)
    if rng.random() < 0.6:
        extend = int(choose(rng, [(2, 0), (3, 1), (2, 2), (1, 3)]))
        use("--extend", extend)
        features.add(f"extend {extend}")
    if rng.random() < 0.35:
        kind, a, b = draw_bounds(rng, mesh, spacing)
        use("--bounds=" + ",".join(repr(float(x)) for x in (*a, *b)))
        features.add(f"bounds {kind}")
    if refine != "uniform":
        # Small enough that error refinement ends early and flat grids are capped now and then.
        use("--max-voxels", int(10.0 ** rng.uniform(4.9, 5.5)) * (3 if brick_size == 16 else 1) * (2 if "--spacing" in arguments else 1))
    elif rng.random() < 0.2:
        use("--max-voxels", int(10.0 ** rng.uniform(4.5, 5.3)))
    if rng.random() < 0.25:
        use("--half")
        features.add("half")
    if rng.random() < 0.4:
        use("--background", -7.5)
        features.add("background")
    up = choose(rng, [(6, None), (1, "y"), (1, "z")])
    if up:
        use("--up-axis", up)
        features.add("up axis")
    if rng.random() < 0.15:
        use("--unit-scale", choose(rng, [(1, 1000), (1, 0.01)]) if longest > 1e-3 else 1e6)
        features.add("unit scale")
    # Drawn in any case, so that a seed makes the same plan for every list of algorithms.
    draws = rng.random(2)
    algorithm = "software"
    others = [a for a in algorithms if a != "software"]
    if others and ("software" not in algorithms or draws[0] < 0.1):
        algorithm = others[int(draws[1] * len(others))]
    features.add(algorithm)
    use("--algorithm", algorithm, "--threads", rng.integers(1, 3))
    # Drawn last, so that the plans of older seeds stay as they were.
    if rng.random() < 0.4 and layout == "levels":
        use("--brick-statistics")
        features.add("brick statistics")
    return arguments, features
