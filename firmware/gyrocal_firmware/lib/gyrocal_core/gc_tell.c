#include "gc_tell.h"

#include "gc_error.h"

#include <math.h>
#include <string.h>

void gc_teller_init(gc_teller_t *teller, const gc_port_t *port, unsigned imu) {
    memset(teller, 0, sizeof *teller);
    teller->port = port;
    teller->imu = imu;
}

void gc_tell_packed(gc_teller_t *teller) {
    char frame[GC_PACK_FRAME_MAX];
    const unsigned samples = teller->pack.samples;
    if (samples == 0u) {
        return;
    }
    const size_t n = gc_pack_end(&teller->pack, frame);
    if (teller->port->send(teller->port->context, frame, n) != (int)n) {
        teller->lost += samples;
    }
}

void gc_tell_pack(gc_teller_t *teller, int64_t number, uint64_t t_us, const gc_sample_t *sample) {
    if (!gc_pack_takes(&teller->pack, number, t_us, sample)) {
        gc_tell_packed(teller);
    }
    gc_pack_add(&teller->pack, teller->imu, teller->seq++, number, t_us, sample);
}

gc_sentence_t *gc_tell_begin_at(gc_teller_t *teller, const char tag[3], uint64_t t_us) {
    gc_tell_packed(teller);
    gc_sentence_begin(&teller->sentence, tag, teller->seq++, t_us, teller->imu);
    return &teller->sentence;
}

gc_sentence_t *gc_tell_begin(gc_teller_t *teller, const char tag[3]) {
    return gc_tell_begin_at(teller, tag, teller->port->now_us(teller->port->context));
}

static bool send(gc_teller_t *teller, int n) {
    return teller->port->send(teller->port->context, teller->sentence.text, (size_t)n) == n;
}

void gc_tell_end(gc_teller_t *teller) {
    const int n = gc_sentence_end(&teller->sentence);
    if (n < 0 || !send(teller, n)) {
        teller->lost++;
    }
}

bool gc_tell_end_or_wait(gc_teller_t *teller) {
    const int n = gc_sentence_end(&teller->sentence);
    if (n > 0 && !send(teller, n)) {
        teller->seq--;
        return false;
    }
    return true;
}

void gc_tell_error(gc_teller_t *teller, int code) {
    gc_sentence_t *s = gc_tell_begin(teller, "ERR");
    gc_sentence_int(s, "code", code);
    gc_sentence_text(s, "name", gc_error_name(code));
    gc_sentence_text(s, "advice", gc_error_advice(code));
    gc_tell_end(teller);
}

void gc_tell_ack(gc_teller_t *teller, const char *command, const char *name, const char *value) {
    gc_sentence_t *s = gc_tell_begin(teller, "ACK");
    gc_sentence_text(s, "cmd", command);
    if (name != NULL) {
        gc_sentence_text(s, name, value);
    }
    gc_tell_end(teller);
}

const char *gc_axis_name(int axis) {
    static const char *const names[] = {"x", "y", "z"};
    return names[axis];
}

const char *gc_face_name(int face) {
    return face > 0 ? "up" : "down";
}

/* One field where the axes have one limit, else one a axis. */
static void tell_limit(gc_sentence_t *s, const char *name, const char *const names[3], const double limit_dps[3]) {
    const bool alike = limit_dps[0] == limit_dps[1] && limit_dps[0] == limit_dps[2];
    const bool none = isnan(limit_dps[0]) && isnan(limit_dps[1]) && isnan(limit_dps[2]);
    if (alike || none) {
        gc_sentence_real(s, name, limit_dps[0]);
        return;
    }
    for (unsigned i = 0; i < 3u; i++) {
        gc_sentence_real(s, names[i], limit_dps[i]);
    }
}

void gc_tell_self_test(gc_teller_t *teller, const gc_self_test_t *result) {
    static const char *const changes[] = {"x_dps", "y_dps", "z_dps"}, *const least[] = {"least_x_dps", "least_y_dps", "least_z_dps"},
                      *const most[] = {"most_x_dps", "most_y_dps", "most_z_dps"}, *const rests[] = {"rest_x_dps", "rest_y_dps", "rest_z_dps"};
    gc_sentence_t *s = gc_tell_begin(teller, "TST");
    gc_sentence_uint(s, "passed", result->passed ? 1u : 0u);
    for (unsigned i = 0; i < 3u; i++) {
        gc_sentence_real(s, changes[i], result->change_dps[i]);
    }
    tell_limit(s, "least_dps", least, result->least_dps);
    tell_limit(s, "most_dps", most, result->most_dps);
    if (!isnan(result->rest_most_dps)) {
        for (unsigned i = 0; i < 3u; i++) {
            gc_sentence_real(s, rests[i], result->rest_dps[i]);
        }
        gc_sentence_real(s, "rest_most_dps", result->rest_most_dps);
    }
    gc_tell_end(teller);
}
