#include "gc_tell.h"

#include "gc_error.h"

#include <string.h>

void gc_teller_init(gc_teller_t *teller, const gc_port_t *port, unsigned imu) {
    memset(teller, 0, sizeof *teller);
    teller->port = port;
    teller->imu = imu;
}

gc_sentence_t *gc_tell_begin_at(gc_teller_t *teller, const char tag[3], uint64_t t_us) {
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
