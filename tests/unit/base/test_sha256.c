#include "rig.h"

#include "base/sha256.h"

#include <string.h>

static const char *digest(const void *bytes, size_t n, size_t piece)
{
    static char hex[SHA256_HEX];
    struct sha256 s;
    sha256_init(&s);
    for (size_t at = 0; at < n; at += piece) sha256_add(&s, (const char *)bytes + at, piece < n - at ? piece : n - at);
    sha256_hex(&s, hex);
    return hex;
}

/* FIPS 180-4, examples of NIST's "SHA256.pdf"; the empty message and the one of a million letters from FIPS 180-2. */
static void the_published_examples_come_out(void **state)
{
    static const struct {
        const char *text, *hex;
    } rows[] = {
        {"", "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"},
        {"abc", "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"},
        {"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq",
         "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1"},
    };
    (void)state;
    for (size_t i = 0; i < COUNT(rows); i++)
        assert_string_equal(digest(rows[i].text, strlen(rows[i].text), 7), rows[i].hex);
    static char million[1000000];
    memset(million, 'a', sizeof million);
    assert_string_equal(digest(million, sizeof million, 4096),
                        "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

static void the_digest_does_not_depend_on_the_pieces(void **state)
{
    char text[200], whole[SHA256_HEX];
    (void)state;
    for (size_t n = 0; n < sizeof text; n++) {
        text[n] = (char)(n * 37);
        strcpy(whole, digest(text, n, sizeof text));
        for (size_t piece = 1; piece < 70; piece += 3) assert_string_equal(digest(text, n, piece), whole);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_published_examples_come_out),
        cmocka_unit_test(the_digest_does_not_depend_on_the_pieces),
    };
    return cmocka_run_group_tests_name("sha256", tests, NULL, NULL);
}
