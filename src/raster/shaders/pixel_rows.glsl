// Which points of a row may lie in an element: its distances to the faces rise evenly along the row.
// Far from rounding, and more than what an element is given beyond its faces.
const float kSurely = 1.0 / 64.0;

// Where the points of a row of `last` + 1 begin and end at which no distance is below zero; none: begin > end.
vec2 rowWithin(vec4 at, vec4 rise, float last) {
    bvec4 rises = greaterThan(rise, vec4(0)), falls = lessThan(rise, vec4(0));
    if (any(lessThan(at + max(rise, vec4(0)) * last, vec4(0)))) return vec2(1, 0);
    vec4 cut = -at / rise;
    vec4 begin = mix(vec4(0), cut, rises), end = mix(vec4(last), cut, falls);
    return vec2(ceil(max(max(max(begin.x, begin.y), max(begin.z, begin.w)), 0.0)),
                floor(min(min(min(end.x, end.y), min(end.z, end.w)), last)));
}
