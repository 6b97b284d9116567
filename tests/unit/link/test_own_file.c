#define _GNU_SOURCE /* mkdtemp */
#include "rig.h"

#include "base/why.h"
#include "link/http.h"
#include "link/own_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

struct world {
    char folder[32], path[64], other[64];
};

static int set_up(void **state)
{
    struct world *w = calloc(1, sizeof *w);
    assert_non_null(w);
    strcpy(w->folder, "/tmp/own-file-XXXXXX");
    assert_non_null(mkdtemp(w->folder));
    snprintf(w->path, sizeof w->path, "%s/file", w->folder);
    snprintf(w->other, sizeof w->other, "%s/other", w->folder);
    *state = w;
    return 0;
}

static int tear_down(void **state)
{
    struct world *w = *state;
    unlink(w->path);
    unlink(w->other);
    rmdir(w->folder);
    free(w);
    return 0;
}

static int own(const struct world *w)
{
    long owner = 0;
    return own_file_open(w->path, &owner);
}

/* What another process gets; 0: it has the file. */
static int tried_by_another(const struct world *w, long *owner)
{
    int ends[2];
    long told = 0;
    assert_int_equal(pipe(ends), 0);
    const pid_t pid = fork();
    if (pid == 0) {
        const int fd = own_file_open(w->path, &told);
        (void)!write(ends[1], &told, sizeof told);
        _exit(fd < 0 ? -fd : 0);
    }
    int status = 0;
    assert_int_equal(read(ends[0], owner, sizeof *owner), sizeof *owner);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    close(ends[0]);
    close(ends[1]);
    return WEXITSTATUS(status);
}

static void a_file_has_one_owner_until_its_process_closes_it(void **state)
{
    const struct world *w = *state;
    long owner = -1;
    const int fd = own(w);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, "precious\n", 9), 9);
    assert_int_equal(tried_by_another(w, &owner), EBUSY);
    assert_int_equal(owner, getpid());
    struct stat st;
    assert_int_equal(stat(w->path, &st), 0);
    assert_int_equal(st.st_size, 9); /* who is refused has not emptied it */
    close(fd);
    assert_int_equal(tried_by_another(w, &owner), 0);
    assert_int_equal(stat(w->path, &st), 0);
    assert_int_equal(st.st_size, 0);
}

/* Opens a master; path (64 bytes) is its slave's. */
static int master(char *path)
{
    const int fd = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(fd >= 0);
    assert_int_equal(grantpt(fd), 0);
    assert_int_equal(unlockpt(fd), 0);
    assert_int_equal(ptsname_r(fd, path, 64), 0);
    return fd;
}

/* Whoever uses the port may lock it for himself with flock's lock. */
static void a_port_shows_who_serves_it(void **state)
{
    int ends[2];
    long told = 0;
    char path[64], other[64];
    const int fd = master(path), second = master(other);
    (void)state;
    assert_int_equal(own_port_owner(path), 0);
    own_port_lock(fd, path);
    assert_int_equal(own_port_owner(path), getpid());
    assert_int_equal(own_port_owner(other), 0);
    assert_int_equal(own_port_owner("/nowhere"), 0);
    assert_int_equal(pipe(ends), 0);
    const pid_t pid = fork();
    if (pid == 0) {
        const int client = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);
        told = flock(client, LOCK_EX | LOCK_NB) == 0 ? own_port_owner(path) : -1;
        (void)!write(ends[1], &told, sizeof told);
        _exit(0);
    }
    assert_int_equal(read(ends[0], &told, sizeof told), sizeof told);
    assert_int_equal(waitpid(pid, NULL, 0), pid);
    assert_int_equal(told, getpid());
    close(fd);
    assert_int_equal(own_port_owner(path), 0);
    close(second);
    close(ends[0]);
    close(ends[1]);
}

static void a_device_has_any_number_of_writers(void **state)
{
    long owner = 0;
    (void)state;
    const int one = own_file_open("/dev/null", &owner), two = own_file_open("/dev/null", &owner);
    assert_true(one >= 0 && two >= 0);
    assert_false(own_file_gone(one, "/dev/null"));
    close(one);
    close(two);
    assert_int_equal(own_file_open("/nowhere/file", &owner), -ENOENT);
    assert_int_equal(own_file_open("/tmp", &owner), -EISDIR);
}

static void a_file_is_gone_when_its_name_leads_elsewhere(void **state)
{
    const struct world *w = *state;
    const int fd = own(w);
    assert_false(own_file_gone(fd, w->path));
    assert_int_equal(rename(w->path, w->other), 0);
    assert_true(own_file_gone(fd, w->path));
    const int another = own(w);
    assert_true(own_file_gone(fd, w->path));
    assert_false(own_file_gone(another, w->path));
    close(fd);
    close(another);
}

static void a_cut_leaves_whole_lines(void **state)
{
    static const struct {
        const char *text;
        off_t left;
    } cases[] = {{"", 0}, {"no end", 0}, {"one\n", 4}, {"one\ntw", 4}, {"one\n\n", 5}};
    const struct world *w = *state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const int fd = own(w);
        assert_int_equal(write(fd, cases[i].text, strlen(cases[i].text)), strlen(cases[i].text));
        assert_int_equal(own_file_cut(fd), cases[i].left);
        assert_int_equal(lseek(fd, 0, SEEK_END), cases[i].left);
        close(fd);
    }
}

/* The last end of line is further back than what is read at once. */
static void a_long_line_is_cut_as_a_whole(void **state)
{
    const struct world *w = *state;
    char part[1000];
    const int fd = own(w);
    memset(part, 'x', sizeof part);
    assert_int_equal(write(fd, "a\n", 2), 2);
    for (int i = 0; i < 20; i++) assert_int_equal(write(fd, part, sizeof part), sizeof part);
    assert_int_equal(own_file_cut(fd), 2);
    close(fd);
}

static void whose_fault_it_is_follows_from_the_error(void **state)
{
    bool user = false;
    char why[200];
    (void)state;
    assert_true(why_machine(ENOSPC) && why_machine(EMFILE) && why_machine(ESTALE));
    assert_false(why_machine(ENOENT) || why_machine(EACCES) || why_machine(EBUSY));
    assert_null(own_file_output("--vcd ", "/nowhere/x", &user, why, sizeof why));
    assert_true(user);
    assert_string_equal(why, "--vcd /nowhere/x: expected a path that can be written, got no such folder");
    assert_string_equal(own_file_strerror(ESTALE), "moved, removed or replaced while it was written");
}

static void a_browser_shows_by_its_first_bytes(void **state)
{
    static const char *const yes[] = {"GET / H", "POST /", "OPTIONS ", "HEAD /", "Host: a", "\x16\x03\x01"};
    static const char *const no[] = {"",      "G",        "GET",       "POSTS ", "HEAD:ANG",
                                     "*IDN?", "< open c", "{\"id\":1", "get ",   "\x16"};
    (void)state;
    for (size_t i = 0; i < sizeof yes / sizeof *yes; i++) assert_true(http_begins(yes[i], strlen(yes[i])));
    for (size_t i = 0; i < sizeof no / sizeof *no; i++) assert_false(http_begins(no[i], strlen(no[i])));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_file_has_one_owner_until_its_process_closes_it, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_port_shows_who_serves_it, set_up, tear_down),
        cmocka_unit_test(a_device_has_any_number_of_writers),
        cmocka_unit_test_setup_teardown(a_file_is_gone_when_its_name_leads_elsewhere, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_cut_leaves_whole_lines, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_long_line_is_cut_as_a_whole, set_up, tear_down),
        cmocka_unit_test(whose_fault_it_is_follows_from_the_error),
        cmocka_unit_test(a_browser_shows_by_its_first_bytes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
