#!/bin/sh
# Process 1 of the guest kernel that tests/uml/run boots on the host's own file system: devices, CAN, the job, its exit status, power off.
# The kernel passes psadir=DIR (no blanks in it) from its command line; DIR/job.env holds what run wants done.
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
. "$psadir/job.env" # PSA_JOB PSA_CWD PSA_MODULES PSA_TIMEOUT_S PSA_ARGS PSA_SERIAL HOME VIRTUAL_ENV PSA_PATH

mount -t proc proc /proc
mount -t sysfs sysfs /sys
# devtmpfs hides the host's /dev, so what programs expect there is made here.
mkdir -p /dev/pts /dev/shm
mount -t devpts devpts /dev/pts -o newinstance,ptmxmode=0666
ln -sf pts/ptmx /dev/ptmx
mount -t tmpfs tmpfs /dev/shm
ln -sf /proc/self/fd /dev/fd
for n in 0:stdin 1:stdout 2:stderr; do ln -sf /proc/self/fd/${n%:*} /dev/${n#*:}; done
# Sockets and other short-lived files stay in the guest's memory: hostfs would leave them on the host.
mkdir /dev/shm/tmp
export TMPDIR=/dev/shm/tmp TERM="${TERM:-dumb}" HOME VIRTUAL_ENV PSA_SERIAL PSABENCH_GUEST=uml
export PATH="$PSA_PATH"

set_up_can() {
    for m in net/can/can net/can/can-raw net/can/can-bcm net/can/can-gw drivers/net/can/dev/can-dev drivers/net/can/vcan \
        drivers/net/can/slcan/slcan; do
        insmod "$PSA_MODULES/kernel/$m.ko" || return 1
    done
    ip link set lo up && ip link add vcan0 type vcan && ip link set vcan0 mtu 72 && ip link set vcan0 up
}

exec >/dev/ttyS1 2>&1
stty -F /dev/ttyS1 -opost # LF would come out as CR LF otherwise
cd "$PSA_CWD" || exit 1
rc=125 # the runner's own failure, as env(1) and timeout(1) use it
if set_up_can; then
    # A session of its own: a job that signals its process group must not meet process 1.
    eval "setsid -w timeout -k 5 $PSA_TIMEOUT_S \"\$PSA_JOB\" $PSA_ARGS" </dev/null
    rc=$?
else
    echo "uml: CAN could not be set up in the guest" >&2
fi
echo "$rc" >"$psadir/rc.part" && mv "$psadir/rc.part" "$psadir/rc"
sync
echo o >/proc/sysrq-trigger # power off; the kernel does it from a work queue
sleep 10
