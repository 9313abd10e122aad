#include "gc_format.h"

#include "gc_error.h"

#include <stdbool.h>
#include <string.h>

#define DIGITS 9
#define BASE 1000000000u /* a limb holds nine decimal digits */
#define INTEGER_LIMBS 35 /* 2^1024 has 309 digits */
#define FRACTION_LIMBS 120 /* 2^-1074 has 1074 */
#define LIMBS (INTEGER_LIMBS + FRACTION_LIMBS)

size_t gc_format_uint(uint64_t value, char *out) {
    char reversed[GC_FORMAT_MAX];
    size_t n = 0;
    do {
        reversed[n++] = (char)('0' + (int)(value % 10u));
        value /= 10u;
    } while (value != 0u);
    for (size_t i = 0; i < n; i++) {
        out[i] = reversed[n - 1u - i];
    }
    return n;
}

size_t gc_format_int(int64_t value, char *out) {
    if (value >= 0) {
        return gc_format_uint((uint64_t)value, out);
    }
    out[0] = '-';
    return 1u + gc_format_uint(0u - (uint64_t)value, out + 1);
}

/* The exact decimal expansion of mantissa * 2^exponent, in limbs of nine digits around the decimal point.
   first and end bound the limbs that are not zero. */
static void expand(uint64_t mantissa, int exponent, uint32_t limb[LIMBS], int *first, int *end) {
    memset(limb, 0, LIMBS * sizeof limb[0]);
    int lo = INTEGER_LIMBS;
    int hi = INTEGER_LIMBS;
    while (mantissa != 0u) {
        limb[--lo] = (uint32_t)(mantissa % BASE);
        mantissa /= BASE;
    }
    while (exponent > 0) {
        const int shift = exponent < 29 ? exponent : 29;
        uint32_t carry = 0;
        for (int i = hi - 1; i >= lo; i--) {
            const uint64_t x = ((uint64_t)limb[i] << shift) + carry;
            limb[i] = (uint32_t)(x % BASE);
            carry = (uint32_t)(x / BASE);
        }
        if (carry != 0u) {
            limb[--lo] = carry;
        }
        exponent -= shift;
    }
    while (exponent < 0) {
        const int shift = -exponent < 9 ? -exponent : 9; /* 10^9 is divisible by 2^9, so the carry stays an integer */
        uint32_t carry = 0;
        for (int i = lo; i < hi; i++) {
            const uint32_t rest = limb[i] & ((1u << shift) - 1u);
            limb[i] = (limb[i] >> shift) + carry;
            carry = (BASE >> shift) * rest;
        }
        if (carry != 0u) {
            limb[hi++] = carry;
        }
        exponent += shift;
    }
    while (lo < hi && limb[lo] == 0u) {
        lo++;
    }
    *first = lo;
    *end = hi;
}

/* Nine digits of a positive number and the power of ten of the first. */
static int nine_digits(double value, uint8_t digit[DIGITS]) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    const int biased = (int)(bits >> 52 & 0x7FFu);
    uint64_t mantissa = bits & 0xFFFFFFFFFFFFFu;
    int exponent = -1074;
    if (biased != 0) {
        mantissa |= (uint64_t)1 << 52;
        exponent = biased - 1075;
    }
    uint32_t limb[LIMBS];
    int first;
    int end;
    expand(mantissa, exponent, limb, &first, &end);

    uint8_t all[2 * DIGITS]; /* the digits of the first two limbs: nine wanted, one or more that decide the rounding */
    for (int k = 0; k < 2; k++) {
        uint32_t x = first + k < end ? limb[first + k] : 0u;
        for (int i = DIGITS - 1; i >= 0; i--) {
            all[k * DIGITS + i] = (uint8_t)(x % 10u);
            x /= 10u;
        }
    }
    int lead = 0;
    while (all[lead] == 0u) {
        lead++;
    }
    int power = (INTEGER_LIMBS - 1 - first) * 9 + 8 - lead;
    memcpy(digit, all + lead, DIGITS);

    int rest = (int)all[lead + DIGITS] * 2; /* twice the cut-off part, in tenths of the last digit: 10 is half */
    bool beyond = false;
    for (int i = lead + DIGITS + 1; i < 2 * DIGITS; i++) {
        beyond = beyond || all[i] != 0u;
    }
    for (int i = first + 2; i < end; i++) {
        beyond = beyond || limb[i] != 0u;
    }
    rest += beyond ? 1 : 0;
    if (rest > 10 || (rest == 10 && digit[DIGITS - 1] % 2u == 1u)) {
        int i = DIGITS - 1;
        while (i >= 0 && digit[i] == 9u) {
            digit[i--] = 0u;
        }
        if (i >= 0) {
            digit[i]++;
        } else {
            digit[0] = 1u;
            power++;
        }
    }
    return power;
}

size_t gc_format_real(double value, char *out) {
    size_t n = 0;
    if (!(value - value == 0.0)) {
        return 0;
    }
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    if (bits >> 63) {
        out[n++] = '-';
        value = -value;
    }
    if (value == 0.0) {
        out[n++] = '0';
        return n;
    }
    uint8_t digit[DIGITS];
    int power = nine_digits(value, digit);
    int count = DIGITS;
    while (count > 1 && digit[count - 1] == 0u) {
        count--;
    }
    if (power >= -4 && power < DIGITS) {
        for (int place = power > 0 ? power : 0; place >= 0 || power - place < count; place--) {
            const int i = power - place;
            if (place == -1) {
                out[n++] = '.';
            }
            out[n++] = (char)('0' + (i >= 0 && i < count ? digit[i] : 0));
        }
        return n;
    }
    for (int i = 0; i < count; i++) {
        out[n++] = (char)('0' + digit[i]);
        if (i == 0 && count > 1) {
            out[n++] = '.';
        }
    }
    out[n++] = 'e';
    out[n++] = power < 0 ? '-' : '+';
    power = power < 0 ? -power : power;
    if (power < 10) {
        out[n++] = '0';
    }
    return n + gc_format_uint((uint64_t)power, out + n);
}

static bool is_digit(char c) {
    return c >= '0' && c <= '9';
}

static double power_of_ten(int n) {
    double result = 1.0;
    double square = 10.0;
    for (; n > 0; n >>= 1) {
        if (n & 1) {
            result *= square;
        }
        square *= square;
    }
    return result;
}

int gc_parse_real(const char *text, size_t n, double *value) {
    size_t i = 0;
    const bool negative = n > 0u && text[0] == '-';
    if (n > 0u && (text[0] == '-' || text[0] == '+')) {
        i++;
    }
    uint64_t mantissa = 0;
    int exponent = 0;
    bool any = false;
    bool point = false;
    for (; i < n && (is_digit(text[i]) || (text[i] == '.' && !point)); i++) {
        if (text[i] == '.') {
            point = true;
            continue;
        }
        any = true;
        if (mantissa < UINT64_MAX / 10u - 1u) {
            mantissa = mantissa * 10u + (uint64_t)(text[i] - '0');
            exponent -= point ? 1 : 0;
        } else {
            exponent += point ? 0 : 1;
        }
    }
    if (any && i < n && (text[i] == 'e' || text[i] == 'E')) {
        i++;
        const bool minus = i < n && text[i] == '-';
        if (i < n && (text[i] == '-' || text[i] == '+')) {
            i++;
        }
        int e = 0;
        any = false;
        for (; i < n && is_digit(text[i]); i++) {
            any = true;
            e = e < 10000 ? e * 10 + (text[i] - '0') : e;
        }
        exponent += minus ? -e : e;
    }
    if (!any || i != n) {
        return GC_E_NUMBER;
    }
    double result = (double)mantissa;
    if (mantissa == 0u) {
        exponent = 0;
    }
    if (exponent > 0) {
        result *= power_of_ten(exponent < 400 ? exponent : 400);
    } else if (exponent < -300) { /* 10^-exponent alone would overflow */
        result = result / 1e300 / power_of_ten(exponent > -400 ? -300 - exponent : 100);
    } else {
        result /= power_of_ten(-exponent);
    }
    if (!(result - result == 0.0)) {
        return GC_E_NUMBER;
    }
    *value = negative ? -result : result;
    return GC_OK;
}

int gc_parse_uint(const char *text, size_t n, uint64_t *value) {
    uint64_t result = 0;
    if (n == 0u) {
        return GC_E_NUMBER;
    }
    for (size_t i = 0; i < n; i++) {
        const unsigned d = (unsigned)(text[i] - '0');
        if (!is_digit(text[i]) || result > (UINT64_MAX - d) / 10u) {
            return GC_E_NUMBER;
        }
        result = result * 10u + d;
    }
    *value = result;
    return GC_OK;
}
