/* A program for a microcontroller on Linux's system calls, so that qemu-arm runs what was compiled for a Cortex-M. */
#include <stddef.h>

int main(void);

static int call(int number, int a, int b, int c)
{
    register int r7 __asm__("r7") = number, r0 __asm__("r0") = a, r1 __asm__("r1") = b, r2 __asm__("r2") = c;
    __asm__ volatile("svc 0" : "+r"(r0) : "r"(r7), "r"(r1), "r"(r2) : "memory");
    return r0;
}

void _exit(int status)
{
    for (;;) {
        call(1, status, 0, 0);
    }
}

void _start(void)
{
    _exit(main());
}

int _write(int file, const char *text, int length)
{
    return call(4, file, (int)text, length);
}

/* newlib's printf takes its buffer here. */
void *_sbrk(ptrdiff_t more)
{
    static char heap[1 << 16];
    static size_t used;
    used += (size_t)more;
    return heap + used - (size_t)more;
}

int _close(int file) { return file; }
int _fstat(int file, void *status) { return status ? -1 : file; }
int _isatty(int file) { return file < 3; }
int _lseek(int file, int to, int from) { return file + to + from ? -1 : 0; }
int _read(int file, char *text, int length) { return text ? 0 : file + length; }
int _kill(int process, int signal) { return process + signal ? -1 : 0; }
int _getpid(void) { return 1; }
