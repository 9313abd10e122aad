/* Any counts, scale of a count and rate into both networks: they refuse, or their answer is finite. */
#include "gc_error.h"
#include "gc_net.h"
#include "weights.h"

#include "fuzz.h"

static int finite(double x) {
    return x - x == 0.0;
}

static void ask(const gc_cnn_net_t *table, fuzz_input_t *in) {
    static int16_t counts[GC_SENSES][GC_MAX_CNN_SAMPLES];
    static gc_net_work_t work;
    gc_net_run_t runs[GC_SENSES];
    gc_net_t net;
    gc_net_open(&net, table);
    fuzz_must(net.check(&net) == GC_OK, "a shipped network that does not fit");
    for (unsigned r = 0; r < GC_SENSES; r++) {
        const double size = fuzz_byte(in) % 4u == 3u ? 32768.0 : 20.0;
        const double sense = r == GC_SENSE_POSITIVE ? 1.0 : -1.0;
        runs[r].lsb_dps = fuzz_byte(in) % 4u == 3u ? fuzz_real(in, 1.0) : 0.00875;
        runs[r].w_dps = fuzz_byte(in) % 4u == 3u ? fuzz_real(in, 500.0) : sense * 78.0;
        runs[r].counts = counts[r];
        uint32_t state = 2463534242u + fuzz_byte(in);
        for (unsigned i = 0; i < GC_MAX_CNN_SAMPLES; i++) {
            if (in->taken < in->n) {
                state ^= fuzz_byte(in);
            }
            state = state * 1664525u + 1013904223u;
            const double noise = ((double)(state >> 8) / 8388608.0 - 1.0) * size;
            const double level = size < 100.0 ? sense * 78.0 / 0.00875 : 0.0;
            const double count = level + noise;
            counts[r][i] = (int16_t)(count > 32767.0 ? 32767.0 : count < -32768.0 ? -32768.0 : count);
        }
    }
    memset(&work, 0, sizeof work);
    for (unsigned stage = 0; stage < GC_CHECKPOINTS; stage++) {
        bool done = false;
        int error = GC_OK;
        gc_net_answer_t answer = {0};
        for (unsigned parts = 0; error == GC_OK && !done; parts++) {
            fuzz_must(parts < 100000u, "an answer that does not end");
            error = net.go_on(&net, &work, runs, NULL, stage, &done, &answer);
        }
        if (error != GC_OK) {
            fuzz_must(strcmp(gc_error_name(error), "unknown") != 0, "an error without a name");
            return;
        }
        fuzz_must(finite(answer.scale) && finite(answer.bias_dps), "an answer that is no number");
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n) {
    fuzz_input_t in = {.data = data, .n = n};
    gc_cnn_net_t paper = gc_net;
    paper.convnet = NULL;
    ask(&paper, &in);
    ask(&gc_net, &in);
    return 0;
}
