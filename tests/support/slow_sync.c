/* LD_PRELOAD: a disk that takes its time. The file named by SLOW_SYNC holds one int64, by how many
 * ns each fsync and fdatasync takes longer. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

static const volatile int64_t *longer_ns;

__attribute__((constructor)) static void open_file(void) {
    const char *name = getenv("SLOW_SYNC");
    int fd = name ? open(name, O_RDONLY | O_CLOEXEC) : -1;
    if (fd >= 0) {
        void *page = mmap(NULL, sizeof(int64_t), PROT_READ, MAP_SHARED, fd, 0);
        longer_ns = page == MAP_FAILED ? NULL : page;
        close(fd);
    }
}

static int slowly(const char *name, int fd) {
    int64_t ns = longer_ns ? *longer_ns : 0;
    struct timespec wait = {ns / 1000000000, ns % 1000000000};
    int (*real)(int) = (int (*)(int))dlsym(RTLD_NEXT, name);
    if (ns > 0) nanosleep(&wait, NULL);
    return real(fd);
}

int fsync(int fd) { return slowly("fsync", fd); }

int fdatasync(int fd) { return slowly("fdatasync", fd); }
