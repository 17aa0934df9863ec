// Forgets what is noted of all points.
uniform uint pointCount;

void main() {
    uint at = threadIndex();
    if (at < pointCount) owners[at] = orders[at] = 0u;
}
