#define _GNU_SOURCE /* mkdtemp */
#include "rig.h"

#include "link/ctl_sock.h"

#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

enum { OPENINGS = 4000 };

struct world {
    char folder[32], path[128];
    struct links links;
    struct ctl_server server;
};

static int set_up(void **state)
{
    struct world *w = calloc(1, sizeof *w);
    assert_non_null(w);
    strcpy(w->folder, "/tmp/ctl-sock-XXXXXX");
    assert_non_null(mkdtemp(w->folder));
    snprintf(w->path, sizeof w->path, "%s/control", w->folder);
    w->server = (struct ctl_server){.name = "control socket", .links = &w->links, .listen.link.fd = -1};
    *state = w;
    return 0;
}

static int tear_down(void **state)
{
    struct world *w = *state;
    ctl_close(&w->server);
    const int left = rmdir(w->folder);
    free(w);
    return left;
}

/* As a client that has seen the path. 0, or errno. */
static int try_to_connect(const char *path)
{
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    strcpy(a.sun_path, path);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0);
    const int err = connect(fd, (struct sockaddr *)&a, sizeof a) < 0 ? errno : 0;
    close(fd);
    return err;
}

static void name_of_opening(struct world *w, int i)
{
    snprintf(w->path, sizeof w->path, "%s/control%d", w->folder, i);
}

/* Tries from before the path is there, and says each time how it ended. */
static _Noreturn void connect_each_time(struct world *w, int said)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL); /* it waits for a path that a test which ended early does not make */
    for (int i = 0; i < OPENINGS; i++) {
        int err;
        name_of_opening(w, i);
        do err = try_to_connect(w->path);
        while (err == ENOENT);
        if (write(said, &err, sizeof err) != sizeof err) break;
    }
    _exit(0);
}

static void path_appears_when_a_client_can_connect(void **state)
{
    struct world *w = *state;
    int ends[2], refused = 0, failed = 0, err = 0;
    long owner = 0;
    assert_int_equal(pipe(ends), 0);
    const pid_t client = fork();
    if (client == 0) connect_each_time(w, ends[1]);
    close(ends[1]);
    for (int i = 0; i < OPENINGS && !failed; i++) {
        name_of_opening(w, i);
        failed = ctl_listen(&w->server, w->path, &owner);
        refused += read(ends[0], &err, sizeof err) != sizeof err || err;
        ctl_close(&w->server);
        links_reap(&w->links);
    }
    kill(client, SIGKILL);
    assert_int_equal(waitpid(client, NULL, 0), client);
    close(ends[0]);
    assert_int_equal(failed, 0);
    assert_int_equal(refused, 0);
}

static void a_path_as_long_as_allowed_works(void **state)
{
    struct world *w = *state;
    long owner = 0;
    char *end = w->path + strlen(w->folder) + 1;
    const size_t room = CTL_PATH_MAX - (size_t)(end - w->path);
    memset(end, 'x', room + 1);
    end[room + 1] = '\0';
    assert_int_equal(ctl_listen(&w->server, w->path, &owner), -ENAMETOOLONG);
    end[room] = '\0';
    assert_int_equal(ctl_listen(&w->server, w->path, &owner), 0);
    assert_int_equal(try_to_connect(w->path), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(path_appears_when_a_client_can_connect, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_path_as_long_as_allowed_works, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
