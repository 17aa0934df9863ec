// The shape of an element, in double and operation by operation as src/raster/element_shape.cpp sets it up.
const int kEasy = 0, kThin = 1, kHard = 2;

struct Shape {
    dvec3 normal[4];  // inward, of unit length
    double offset[4], height[4];
    double slack, margin;
    int grade;
};

double lengthOf(dvec3 v) {
    precise double squares = v.x * v.x + v.y * v.y + v.z * v.z;
    precise double result = sqrt(squares);
    return result;
}

// The largest displacement of a plane by rounding; huge where a face is too thin.
double setUpFaces(Placed placed, double size, inout Shape shape) {
    const double kHuge = 1e30LF;
    precise double worst = 0.0LF;
    for (int face = 0; face < 4; ++face) {
        dvec3 a = placed.node[(face + 1) & 3];
        precise dvec3 p = placed.node[(face + 2) & 3] - a, q = placed.node[(face + 3) & 3] - a;
        precise dvec3 n = p.yzx * q.zxy - p.zxy * q.yzx;
        double largest = max(max(abs(n.x), abs(n.y)), abs(n.z));
        if (!(largest > 0.0LF)) return kHuge;
        precise dvec3 scaled = n / largest;
        double lengthScaled = lengthOf(scaled);
        precise double displaced =
            PLANE_ROUNDING * size * size * (size + 1.0LF) / (largest * lengthScaled);
        worst = max(worst, displaced);
        precise dvec3 d = placed.node[face] - a;
        precise double inner = scaled.x * d.x + scaled.y * d.y + scaled.z * d.z;
        precise dvec3 normal = (inner < 0.0LF ? -scaled : scaled) / lengthScaled;
        precise double at = normal.x * a.x + normal.y * a.y + normal.z * a.z;
        shape.normal[face] = normal;
        shape.offset[face] = -at;
        precise double height = abs(inner) / lengthScaled;
        shape.height[face] = height;
    }
    return worst;
}

double cornerReach(Placed placed, Shape shape) {
    precise double inverse[4];
    for (int j = 0; j < 4; ++j) inverse[j] = 1.0LF / shape.height[j];
    precise double most = 0.0LF;
    for (int i = 0; i < 4; ++i) {
        precise dvec3 moved = dvec3(0);
        for (int j = 0; j < 4; ++j) moved += (placed.node[i] - placed.node[j]) * inverse[j];
        precise double squares = moved.x * moved.x + moved.y * moved.y + moved.z * moved.z;
        most = max(most, squares);
    }
    precise double result = sqrt(most);
    return result;
}

Shape shapeElement(Placed placed) {
    Shape shape;
    shape.grade = kHard;
    shape.slack = shape.margin = 0.0LF;
    dvec3 sizes = placed.high - placed.low;
    double size = max(max(sizes.x, sizes.y), sizes.z);
    if (!(size < 1e18LF)) return shape;  // where squares could overflow
    double planeError = setUpFaces(placed, size, shape);
    if (!(planeError < MOST_PLANE_ERROR)) return shape;
    double thinnest = min(min(shape.height[0], shape.height[1]), min(shape.height[2], shape.height[3]));
    double farthest = max(max(shape.height[0], shape.height[1]), max(shape.height[2], shape.height[3]));
    if (!(thinnest > 8.0LF * planeError) || thinnest > LARGEST_HEIGHT) return shape;
    precise double reach = CORNER_FACTOR * cornerReach(placed, shape);
    precise double arm = min(size, CELL_EDGE) + 1.0LF;
    precise double inFloat = FLOAT_ROUNDING * arm + FLOAT_UNIT * farthest + planeError;
    precise double inDouble = 2.0LF * planeError;
    precise double movedInFloat = 2.0LF * inFloat * reach, movedInDouble = 2.0LF * inDouble * reach;
    if (movedInFloat <= LARGEST_MARGIN) {
        shape.grade = kEasy;
        shape.slack = inFloat;
        shape.margin = movedInFloat;
    } else if (movedInDouble <= LARGEST_MARGIN) {
        shape.grade = kThin;
        shape.slack = inDouble;
        shape.margin = movedInDouble;
    }
    return shape;
}

// What coefficients are relative to, from the element's first voxel: the cell's first point in elements that
// begin before it.
uniform ivec3 cellMin;
dvec3 baseOf(Placed placed) {
    return max(dvec3(0), dvec3(cellMin) - placed.first);
}
// A face's distance at the base.
double offsetAt(Shape shape, int face, dvec3 base) {
    dvec3 n = shape.normal[face];
    precise double at = shape.offset[face] + n.x * base.x + n.y * base.y + n.z * base.z;
    return at;
}
