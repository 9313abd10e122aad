/* exp, tanh and sine with the same bits on every CPU: float32 + - * / and integers only, no libm.
 *
 * Compile with -ffp-contract=off; a fused multiply-add would change last bits.
 * tests/parity/test_math.py measures the errors against float64.
 *
 *   function          largest error     saturation                         tiny input         NaN
 *   gc_exp            1 ulp             > 88.72283 -> +inf,                1                  NaN
 *                                       < -87.33654 (below FLT_MIN) -> 0
 *   gc_tanh           2 ulp             beyond +-9.02 -> +-1               x itself           NaN
 *   gc_sin/cos_turn   1e-7 absolute     |turns| >= 2^23 is whole turns     2 pi turns         NaN (also of +-inf)
 *
 * gc_exp never returns a denormal number, so a CPU that flushes them gives the same bits. gc_tanh and gc_sin_turn return
 * tiny inputs, denormal ones too, to rounding.
 */
#ifndef GC_MATH_H
#define GC_MATH_H

#ifdef __cplusplus
extern "C" {
#endif

float gc_exp(float x);
float gc_tanh(float x);

/* sin and cos of 2 pi turns. The argument is reduced in turns, which is exact; quarter turns give exactly 0 and +-1. */
float gc_sin_turn(float turns);
float gc_cos_turn(float turns);

/* In double: exp(-x) for x >= 0, log(x) for a normal number x > 0, cosine and sine of an angle of at most some turns; within 1e-12. */
double gc_decay(double x);
double gc_log(double x);
void gc_cos_sin(double angle, double *cosine, double *sine);

#ifdef __cplusplus
}
#endif

#endif
