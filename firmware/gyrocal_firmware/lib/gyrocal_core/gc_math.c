#include "gc_math.h"

#include <math.h>

#include <float.h>
#include <stdint.h>
#include <string.h>

#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "float must be evaluated as float: on 32-bit x86 compile with -msse2 -mfpmath=sse"
#endif

static float from_bits(uint32_t bits) {
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static int32_t nearest(float x) {
    return (int32_t)(x < 0.0f ? x - 0.5f : x + 0.5f);
}

float gc_exp(float x) {
    if (x != x) {
        return x;
    }
    if (x > 88.72283f) {
        return from_bits(0x7F800000u);
    }
    if (x < -87.33654f) {
        return 0.0f;
    }
    /* exp(x) = 2^n exp(r), |r| <= ln(2)/2; ln 2 in two parts, n times the first is exact */
    int32_t n = nearest(x * 1.44269504f);
    float r = (x - (float)n * 0.693359375f) + (float)n * 2.12194440e-4f;
    float q = 1.3926176e-3f;
    q = q * r + 8.363173e-3f;
    q = q * r + 4.1666556e-2f;
    q = q * r + 1.6666578e-1f;
    q = q * r + 0.5f;
    float e = 1.0f + (r + r * r * q);
    if (n > 127) { /* 2^128 has no float */
        e *= 2.0f;
        n -= 1;
    }
    return e * from_bits((uint32_t)(n + 127) << 23);
}

float gc_tanh(float x) {
    float size = x < 0.0f ? -x : x;
    if (size < 0.625f) { /* an odd polynomial */
        float u = x * x;
        float q = -6.096714e-3f;
        q = q * u + 2.099718e-2f;
        q = q * u - 5.3850908e-2f;
        q = q * u + 1.333277e-1f;
        q = q * u - 3.3333328e-1f;
        return x + x * (u * q);
    }
    if (x != x) {
        return x;
    }
    float y = size > 9.02f ? 1.0f : 1.0f - 2.0f / (gc_exp(2.0f * size) + 1.0f);
    return x < 0.0f ? -y : y;
}

/* sin(2 pi (turns + quarters / 4)) */
static float sin_quarters(float turns, int32_t quarters) {
    if (turns - turns != 0.0f) {
        return turns - turns; /* NaN, and infinity has no angle */
    }
    float f = turns;
    if (f >= 8388608.0f || f <= -8388608.0f) {
        f = 0.0f;
    } else {
        f -= (float)nearest(f); /* exact, as is the next step */
    }
    int32_t nearest_quarter = nearest(4.0f * f);
    f -= 0.25f * (float)nearest_quarter;
    quarters = (quarters + nearest_quarter) & 3;

    float u = f * f;
    float y;
    if (quarters & 1) {
        y = 59.424107f;
        y = y * u - 85.44882f;
        y = y * u + 64.93937f;
        y = y * u - 19.739208f;
        y = 1.0f + y * u;
    } else {
        y = -75.40161f;
        y = y * u + 81.592545f;
        y = y * u - 41.341663f;
        y = f * 6.2831853f + f * (u * y);
    }
    return quarters & 2 ? -y : y;
}

float gc_sin_turn(float turns) {
    return sin_quarters(turns, 0);
}

float gc_cos_turn(float turns) {
    return sin_quarters(turns, 1);
}

double gc_decay(double x) {
    static const double taylor[] = {1.0,          1.0,           1.0 / 2,        1.0 / 6,         1.0 / 24,
                                    1.0 / 120,    1.0 / 720,     1.0 / 5040,     1.0 / 40320,     1.0 / 362880,
                                    1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800.0};
    if (x > 700.0) {
        return 0.0;
    }
    /* exp(-x) = exp(r) / 2^n, |r| <= ln(2)/2; ln 2 in two parts, n times the first is exact */
    const uint32_t n = (uint32_t)(x * 1.4426950408889634 + 0.5);
    const double r = ((double)n * 0.693147180369123816490 - x) + (double)n * 1.90821492927058770002e-10;
    double sum = 0.0;
    for (unsigned k = 14; k > 0u; k--) { /* the omitted terms are below 5e-18 */
        sum = sum * r + taylor[k - 1u];
    }
    const uint64_t bits = (uint64_t)(1023u - n) << 52;
    double scale;
    memcpy(&scale, &bits, sizeof scale);
    return sum * scale;
}

double gc_log(double x) {
    static const double inverse[] = {1.0, 1.0 / 3, 1.0 / 5, 1.0 / 7, 1.0 / 9, 1.0 / 11, 1.0 / 13, 1.0 / 15, 1.0 / 17, 1.0 / 19};
    int32_t n = 0;
    if (x < DBL_MIN) { /* the exponent of a denormal number does not give its size */
        x *= 18014398509481984.0;
        n = -54;
    }
    /* log(x) = n log(2) + log(m), m from 1/sqrt(2) to sqrt(2) */
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    n += (int32_t)(bits >> 52) - 1023;
    bits = (bits & 0xFFFFFFFFFFFFFu) | 0x3FF0000000000000u;
    double m;
    memcpy(&m, &bits, sizeof m);
    if (m > 1.4142135623730951) {
        m *= 0.5;
        n++;
    }
    const double z = (m - 1.0) / (m + 1.0); /* at most 0.172 */
    const double square = z * z;
    double sum = 0.0;
    for (unsigned k = 10; k > 0u; k--) { /* the omitted terms are a fraction below 1e-16 */
        sum = sum * square + inverse[k - 1u];
    }
    return (double)n * 0.69314718055994531 + 2.0 * z * sum;
}

void gc_cos_sin(double angle, double *cosine, double *sine) {
    unsigned doublings = 0;
    for (; fabs(angle) > 0.1; angle *= 0.5) {
        doublings++;
    }
    double term = angle;
    double s = angle;
    double versine = 0.0; /* 1 - cosine, which keeps its digits where the angle is small */
    double even = 1.0;
    for (unsigned k = 1; k <= 7u; k++) {
        even *= -angle * angle / (double)((2u * k - 1u) * 2u * k);
        versine -= even;
        term *= -angle * angle / (double)(2u * k * (2u * k + 1u));
        s += term;
    }
    while (doublings-- > 0u) {
        s = 2.0 * s * (1.0 - versine);
        versine = 2.0 * versine * (2.0 - versine);
    }
    *cosine = 1.0 - versine;
    *sine = s;
}
