#include "gc_flags.h"

#include <string.h>

static const struct {
    uint32_t flag;
    const char *name;
} known[] = {
#define GC_FLAG_NAME(id, bit, name, meaning) {(uint32_t)(id), name},
    GC_FLAGS(GC_FLAG_NAME)
#undef GC_FLAG_NAME
};

size_t gc_flags_text(uint32_t flags, char text[GC_FLAGS_TEXT_MAX]) {
    size_t length = 0;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if ((flags & known[i].flag) != 0u) {
            const size_t n = strlen(known[i].name);
            if (length > 0u) {
                text[length++] = '+';
            }
            memcpy(text + length, known[i].name, n);
            length += n;
        }
    }
    text[length] = '\0';
    return length;
}
