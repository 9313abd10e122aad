/* The shipped network over consecutive windows of two runs, from counts on stdin: LSB W_UP W_DOWN N, then N counts of
   each run. Prints scale and bias of each whole window. */
#include "gc_cnn.h"
#include "gc_error.h"
#include "weights.h"

#include <stdio.h>
#include <stdlib.h>

int main(void) {
    static float up[4096], down[4096];
    float scratch[GC_NET_SCRATCH_FLOATS], out[2];
    double lsb, w_up, w_down;
    unsigned n;
    int count;
    if (scanf("%lf %lf %lf %u", &lsb, &w_up, &w_down, &n) != 4 || n > 4096) {
        return 2;
    }
    for (unsigned i = 0; i < 2 * n; i++) {
        if (scanf("%d", &count) != 1) {
            return 2;
        }
        *(i < n ? up + i : down + (i - n)) = (float)count * (float)lsb - (float)(i < n ? w_up : w_down);
    }
    for (unsigned from = 0; from + gc_net.window <= n; from += gc_net.window) {
        const int error = gc_cnn_run(&gc_net, up + from, down + from, (float)w_up, (float)w_down, scratch, out);
        if (error != GC_OK) {
            printf("%s\n", gc_error_name(error));
            return 1;
        }
        printf("%.9g %.9g\n", (double)out[0], (double)out[1]);
    }
    return 0;
}
