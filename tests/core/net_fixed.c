/* Network `gyrocal` on columns at the ends of its range, half of them at each: prints how many of two thousand faces are answered,
   and fails where a number did not fit. */
#include "gc_net.h"
#include "weights.h"

#include <stdbool.h>
#include <stdio.h>

static uint32_t state = 1;

static uint32_t random_below(uint32_t n) {
    state = state * 1664525u + 1013904223u;
    return (uint32_t)(((uint64_t)state * n) >> 32);
}

/* An output of a layer in 64 bits, of n inputs. */
static int64_t wide_output(const gc_convnet_t *net, const gc_convnet_layer_t *layer, unsigned i, const int64_t *x, unsigned n) {
    int64_t sum = layer->start[i];
    for (unsigned k = 0; k < n; k++) {
        sum += layer->code[i * n + k] * x[k];
    }
    const int64_t y = (sum * layer->gain[i]) >> 32;
    return y < 0 ? (y * net->leak + (1 << 14)) >> 15 : y;
}

/* Whether the convolutions in 64 bits give the numbers that the kernel keeps in 16. */
static bool fits(const gc_convnet_t *net, const gc_convnet_work_t *work) {
    const unsigned channels = net->first.channels, kernel = net->first.kernel, pool = net->second.pool;
    const unsigned taps = channels * net->second.kernel;
    const unsigned rows = net->stage_columns * (work->stage + 1u) - kernel + 1u;
    int64_t columns[GC_CONVNET_MAX_COLUMNS], row[GC_CONVNET_MAX_ROWS], sums[GC_CONVNET_MAX_ROWS];
    bool same = true;
    for (unsigned i = 0; i < rows + kernel - 1u; i++) {
        columns[i] = work->columns[i];
    }
    for (unsigned i = 0; i < rows * channels; i++) {
        row[i] = wide_output(net, &net->first_layer, i % channels, columns + i / channels, kernel);
    }
    for (unsigned i = 0; i < (rows - pool + 1u) * channels; i++) {
        sums[i] = 0;
        for (unsigned k = 0; k < pool; k++) {
            sums[i] += row[i + k * channels];
        }
        same = same && sums[i] == work->sums[i];
    }
    const unsigned times = (rows - net->second.kernel + 1u) / pool;
    for (unsigned i = 0; i < times * net->second.channels; i++) {
        const int64_t *from = sums + i / net->second.channels * pool * channels;
        same = same && wide_output(net, &net->second_layer, i % net->second.channels, from, taps) == work->features[i];
    }
    return same;
}

int main(void) {
    static int16_t counts[GC_MAX_CNN_SAMPLES];
    static gc_convnet_work_t work;
    const double lsb_dps = 0.00875;
    const int end = (int)((double)gc_net.convnet->column_range_dps / lsb_dps);
    unsigned answered = 0;
    for (unsigned i = 0; i < 2000u; i++) {
        const unsigned stage = i % GC_CONVNET_STAGES;
        uint32_t left = gc_net.convnet->stage_columns * (stage + 1u);
        uint32_t up = left / 2u;
        gc_convnet_face_t face;
        for (unsigned k = 0; left > 0u; left--) {
            const bool is_up = random_below(left) < up;
            up -= is_up ? 1u : 0u;
            for (unsigned s = 0; s < gc_net.convnet->pool; s++) {
                counts[k++] = (int16_t)(8914 + (is_up ? end : -end));
            }
        }
        answered += gc_convnet_face(gc_net.convnet, counts, stage, lsb_dps, 78.0, &work, &face) == 0 ? 1u : 0u;
        if (!fits(gc_net.convnet, &work)) {
            fprintf(stderr, "a number does not fit 16 bits\n");
            return 1;
        }
    }
    printf("%u\n", answered);
    return 0;
}
