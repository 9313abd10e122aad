#include "gc_error.h"

const char *gc_error_name(int code) {
    switch (code) {
#define GC_ERROR_NAME(id, value, name, advice) \
    case id: return name;
        GC_ERRORS(GC_ERROR_NAME)
    case GC_OK: return "ok";
    default: return "unknown";
    }
}

const char *gc_error_advice(int code) {
    switch (code) {
#define GC_ERROR_ADVICE(id, value, name, advice) \
    case id: return advice;
        GC_ERRORS(GC_ERROR_ADVICE)
    case GC_OK: return "nothing to do";
    default: return "update firmware and host to one version";
    }
}
