/*
 * What a harmful FMU may try, for oscillator_fmu.c: `attack` returns the names of the attempts that succeed, behind a colon.
 * ATTACK is a folder with a file "database", which belongs to the service.
 */

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <mqueue.h>
#include <net/if.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/ipc.h>
#include <sys/mman.h>
#include <sys/msg.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/sem.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <sys/xattr.h>
#include <unistd.h>

#define DATABASE ATTACK "/database"
#define TRY(name, success) \
    if (success) strcat(strcat(done, " "), name)

static void *idle(void *unused) { return unused; }

static bool starts_thread(void)
{
    pthread_t thread;
    return !pthread_create(&thread, NULL, idle, NULL) && !pthread_join(thread, NULL);
}

static bool forks(void)
{
    pid_t child = fork();
    if (child == 0) _exit(0);
    return child > 0 && waitpid(child, NULL, 0) == child;
}

static bool makes_shared_memory(void)
{
    int segment = shmget(IPC_PRIVATE, 1 << 20, IPC_CREAT | 0600);
    return segment >= 0 && !shmctl(segment, IPC_RMID, NULL);
}

static bool makes_queue(void)
{
    int queue = msgget(IPC_PRIVATE, IPC_CREAT | 0600);
    return queue >= 0 && !msgctl(queue, IPC_RMID, NULL);
}

static bool makes_semaphore(void)
{
    int set = semget(IPC_PRIVATE, 1, IPC_CREAT | 0600);
    return set >= 0 && !semctl(set, 0, IPC_RMID);
}

static bool raises_limit(void)
{
    struct rlimit files;
    return !getrlimit(RLIMIT_FSIZE, &files) && !(files.rlim_cur = files.rlim_max = RLIM_INFINITY, 0) &&
           !setrlimit(RLIMIT_FSIZE, &files);
}

static bool sends_signals_by_file(void)
{
    int ends[2];
    return !pipe2(ends, O_CLOEXEC) && !fcntl(ends[0], F_SETOWN, getppid());
}

static bool locks(const char *path)
{
    return flock(open(path, O_RDONLY), LOCK_EX | LOCK_NB) == 0;
}

static bool changes_by_32_bits(void)
{
#ifdef __x86_64__
    /* chmod of the interface of 32 bits, whose numbers are others; the path has to be in the first 4 GB. */
    char *low = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_32BIT, -1, 0);
    long result;
    strcpy(low, DATABASE);
    __asm__ volatile("int $0x80" : "=a"(result) : "a"(15), "b"(low), "c"(0666) : "memory", "r8", "r9", "r10", "r11");
    return result == 0;
#else
    return false;
#endif
}

const char *attack(void)
{
    static char done[2000], environment[50];
    struct timespec times[2] = {{1, 0}, {1, 0}};
    strcpy(done, "attempts that succeed:");
    snprintf(environment, sizeof environment, "/proc/%d/environ", getppid());
    TRY("chmod", !chmod(DATABASE, 0666));
    TRY("chmod-folder", !chmod(ATTACK, 0777));
    TRY("fchmod", !fchmod(open(DATABASE, O_RDONLY), 0666));
    TRY("fchmodat2", !syscall(452, AT_FDCWD, DATABASE, 0666, 0));
    TRY("chmod-32", changes_by_32_bits());
    TRY("chmod-x32", !syscall(0x40000000 + 90, DATABASE, 0666));
    TRY("chown", !chown(DATABASE, geteuid(), getegid()));
    TRY("utimensat", !utimensat(AT_FDCWD, DATABASE, times, 0));
    TRY("setxattr", !setxattr(DATABASE, "user.evil", "1", 1, 0));
    TRY("truncate", !truncate(DATABASE, 0));
    TRY("open-truncate", open(DATABASE, O_RDONLY | O_TRUNC) >= 0);
    TRY("read", fopen(DATABASE, "r") != NULL);
    TRY("list", opendir(ATTACK) != NULL);
    TRY("environment", fopen(environment, "r") != NULL);
    TRY("write", fopen(DATABASE, "a") != NULL);
    TRY("link", !link(DATABASE, ATTACK "/link"));
    TRY("rename", !rename(ATTACK "/link", ATTACK "/renamed"));
    TRY("unlink", !unlink(ATTACK "/renamed"));
    TRY("mkdir", !mkdir(ATTACK "/folder", 0777));
    TRY("lock", locks("/proc/self/exe"));
    TRY("socket", socket(AF_INET, SOCK_STREAM, 0) >= 0);
    TRY("interface", !ioctl(1, SIOCGIFCONF, &(struct ifconf){0}));
    TRY("shmget", makes_shared_memory());
    TRY("msgget", makes_queue());
    TRY("semget", makes_semaphore());
    TRY("mq_open", mq_open("/evil", O_CREAT | O_RDWR, 0600, NULL) >= 0 && !mq_unlink("/evil"));
    TRY("memfd", syscall(SYS_memfd_create, "evil", 0) >= 0);
    TRY("thread", starts_thread());
    TRY("fork", forks());
    TRY("signal", !kill(getppid(), 0));
    TRY("signal-by-file", sends_signals_by_file());
    TRY("limit-of-parent", !prlimit(getppid(), RLIMIT_NOFILE, NULL, &(struct rlimit){0}));
    TRY("limit", raises_limit());
    TRY("priority", !setpriority(PRIO_PROCESS, 0, 19));
    TRY("key", syscall(SYS_add_key, "user", "evil", "1", 1, -3) >= 0);
    TRY("io_uring", syscall(SYS_io_uring_setup, 1, (char[120]){0}) >= 0);
    TRY("root", !setuid(0));
    return done;
}
