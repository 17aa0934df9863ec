// What the device makes of operations on doubles.
layout(std430, binding = 0) readonly buffer Operands {
    double operands[];
};
layout(std430, binding = 1) writeonly buffer Results {
    double results[];  // OPERATIONS an operand
};
uniform uint count;

void main() {
    uint i = threadIndex();
    if (i >= count) return;
    double a = operands[i], b = operands[(i + 1u) % count];
    precise double sum = a + b, difference = a - b, product = a * b, quotient = a / b, whole = floor(a);
    precise double root = sqrt(abs(a)), chain = a * b + a;
    double asFloat = double(float(a));
    double made[OPERATIONS] = double[](sum, difference, product, quotient, whole, root, chain, asFloat);
    for (uint k = 0u; k < OPERATIONS; ++k) results[i * OPERATIONS + k] = made[k];
}
