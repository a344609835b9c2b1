// SPDX-License-Identifier: BSD-3-Clause
// Lets calls of a process fail, for faults.py: a library to be preloaded.
//   ADASFM_FAULT=KIND:CALL:ERRNO[:keep]  the CALL-th (from 1) of that kind
//     fails, and with `keep` all after it; of memory then those of 64 kB and
//     more, since small ones are what a short machine still has
//   ADASFM_FAULT_COUNTS=PATH  how many calls of each kind there were, a line
//     each, is written there when the process ends
// Kinds: write (to regular files, with truncations), fsync, rename, mmap,
// memory (malloc and its like), thread (pthread_create).
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

enum { kWrite, kFsync, kRename, kMmap, kMemory, kThread, kNumKinds };
static const char* const kNames[kNumKinds] = {"write", "fsync",  "rename",
                                              "mmap",  "memory", "thread"};
static const size_t kLarge = 65536;

static long counts[kNumKinds];
static int armed = 0;  // not before main()
static int kind = -1;
static int error = 0;
static int keep = 0;
static long call = 0;

// Whether this call shall fail; errno is set then.
static int Fails(int this_kind, size_t size) {
  if (!armed) return 0;
  const long count =
      __atomic_add_fetch(&counts[this_kind], 1, __ATOMIC_RELAXED);
  if (this_kind != kind || count < call) return 0;
  if (count > call && !(keep && (kind != kMemory || size >= kLarge))) return 0;
  errno = error;
  return 1;
}

static int WriteFails(int fd) {
  struct stat status;
  const int before = errno;
  const int is_file =
      fd > 2 && fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
  errno = before;
  return is_file && Fails(kWrite, 0);
}

static void WriteCounts(void) {
  const char* path = getenv("ADASFM_FAULT_COUNTS");
  armed = 0;
  FILE* file = path == NULL ? NULL : fopen(path, "w");
  if (file == NULL) return;
  for (int i = 0; i < kNumKinds; ++i) {
    fprintf(file, "%s %ld\n", kNames[i], counts[i]);
  }
  fclose(file);
}

__attribute__((constructor)) static void Begin(void) {
  const char* fault = getenv("ADASFM_FAULT");
  char name[16] = "";
  char rest[16] = "";
  if (fault != NULL &&
      sscanf(fault, "%15[a-z]:%ld:%d:%15s", name, &call, &error, rest) >= 3) {
    for (int i = 0; i < kNumKinds; ++i) {
      if (strcmp(name, kNames[i]) == 0) kind = i;
    }
    keep = strcmp(rest, "keep") == 0;
  }
  // Programs that this one starts are not meant, but their counts would be.
  unsetenv("ADASFM_FAULT");
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

typedef int (*Main)(int, char**, char**);
static Main real_main;

static int ArmedMain(int argc, char** argv, char** environment) {
  atexit(WriteCounts);
  armed = 1;
  return real_main(argc, argv, environment);
}

int __libc_start_main(Main main, int argc, char** argv, Main init,
                      void (*fini)(void), void (*rtld_fini)(void),
                      void* stack_end) {
  real_main = main;
  return REAL(__libc_start_main)(ArmedMain, argc, argv, init, fini, rtld_fini,
                                 stack_end);
}

ssize_t write(int fd, const void* data, size_t size) {
  return WriteFails(fd) ? -1 : REAL(write)(fd, data, size);
}
ssize_t writev(int fd, const struct iovec* parts, int count) {
  return WriteFails(fd) ? -1 : REAL(writev)(fd, parts, count);
}
ssize_t pwrite(int fd, const void* data, size_t size, off_t offset) {
  return WriteFails(fd) ? -1 : REAL(pwrite)(fd, data, size, offset);
}
ssize_t pwrite64(int fd, const void* data, size_t size, off64_t offset) {
  return WriteFails(fd) ? -1 : REAL(pwrite64)(fd, data, size, offset);
}
int ftruncate(int fd, off_t size) {
  return WriteFails(fd) ? -1 : REAL(ftruncate)(fd, size);
}
int ftruncate64(int fd, off64_t size) {
  return WriteFails(fd) ? -1 : REAL(ftruncate64)(fd, size);
}
int fsync(int fd) { return Fails(kFsync, 0) ? -1 : REAL(fsync)(fd); }
int fdatasync(int fd) { return Fails(kFsync, 0) ? -1 : REAL(fdatasync)(fd); }
int rename(const char* from, const char* to) {
  return Fails(kRename, 0) ? -1 : REAL(rename)(from, to);
}
void* mmap(void* address, size_t size, int protection, int flags, int fd,
           off_t offset) {
  return Fails(kMmap, size)
             ? MAP_FAILED
             : REAL(mmap)(address, size, protection, flags, fd, offset);
}
void* mmap64(void* address, size_t size, int protection, int flags, int fd,
             off64_t offset) {
  return Fails(kMmap, size)
             ? MAP_FAILED
             : REAL(mmap64)(address, size, protection, flags, fd, offset);
}
int pthread_create(pthread_t* thread, const pthread_attr_t* attributes,
                   void* (*function)(void*), void* argument) {
  return Fails(kThread, 0)
             ? error
             : REAL(pthread_create)(thread, attributes, function, argument);
}

// dlsym itself takes memory, so these go to glibc's other names.
extern void* __libc_malloc(size_t);
extern void* __libc_calloc(size_t, size_t);
extern void* __libc_realloc(void*, size_t);
extern void* __libc_memalign(size_t, size_t);

void* malloc(size_t size) {
  return Fails(kMemory, size) ? NULL : __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  return Fails(kMemory, count * size) ? NULL : __libc_calloc(count, size);
}
void* realloc(void* old, size_t size) {
  return Fails(kMemory, size) ? NULL : __libc_realloc(old, size);
}
void* memalign(size_t alignment, size_t size) {
  return Fails(kMemory, size) ? NULL : __libc_memalign(alignment, size);
}
void* aligned_alloc(size_t alignment, size_t size) {
  return memalign(alignment, size);
}
int posix_memalign(void** result, size_t alignment, size_t size) {
  void* memory = memalign(alignment, size);
  if (memory == NULL) return ENOMEM;
  *result = memory;
  return 0;
}
