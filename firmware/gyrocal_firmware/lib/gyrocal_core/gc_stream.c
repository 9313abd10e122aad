#include "gc_stream.h"

#include "gc_format.h"

static const char *const names[GC_STREAMS] = {"off", "raw", "teleplot", "corrected", "packed"};

gc_stream_t gc_stream_find(gc_text_t name) {
    unsigned i = 0;
    while (i < GC_STREAMS && !gc_text_equals(name, names[i])) {
        i++;
    }
    return (gc_stream_t)i;
}

const char *gc_stream_name(gc_stream_t stream) {
    return names[stream];
}

bool gc_stream_fits(gc_stream_t stream, double rate_hz) {
    return stream == GC_STREAM_OFF || stream == GC_STREAM_PACKED || rate_hz <= GC_FIFO_ALONE_HZ;
}

static void tell_teleplot(const gc_port_t *port, const gc_sensor_t *sensor, const gc_sample_t *sample) {
    char text[3 * (6 + GC_FORMAT_MAX)];
    size_t n = 0;
    for (int i = 0; i < 3; i++) {
        text[n++] = '>';
        text[n++] = 'g';
        text[n++] = *gc_axis_name(i);
        text[n++] = ':';
        n += gc_format_real(sensor->lsb_dps * sample->gyro[i], text + n);
        text[n++] = '\n';
    }
    (void)port->send(port->context, text, n);
}

void gc_stream_tell(gc_stream_t stream, gc_teller_t *teller, const gc_sensor_t *sensor, const gc_kept_t *kept, int64_t n,
                    const gc_taken_t *taken) {
    const gc_sample_t *sample = &taken->raw;
    if (stream == GC_STREAM_OFF) {
        return;
    }
    if (stream == GC_STREAM_TELEPLOT) {
        tell_teleplot(teller->port, sensor, sample);
        return;
    }
    if (stream == GC_STREAM_PACKED) {
        gc_tell_pack(teller, n, taken->t_us, sample);
        return;
    }
    gc_sentence_t *s = gc_tell_begin_at(teller, stream == GC_STREAM_RAW ? "RAW" : "GYR", taken->t_us);
    gc_sentence_int(s, NULL, n);
    if (stream == GC_STREAM_RAW) {
        for (size_t i = 0; i < 3u; i++) {
            gc_sentence_int(s, NULL, sample->gyro[i]);
        }
        for (size_t i = 0; i < 3u; i++) {
            gc_sentence_int(s, NULL, sample->acc[i]);
        }
        gc_sentence_int(s, NULL, sample->temp);
    } else {
        for (unsigned i = 0; i < 3u; i++) {
            gc_sentence_real(s, NULL, gc_kept_corrected(kept, i, sensor->lsb_dps * sample->gyro[i]));
        }
    }
    gc_tell_end(teller);
}
