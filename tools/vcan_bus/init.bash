#!/bin/bash
# Process 1 of the user-mode-linux guest: makes vcan0, runs the command, switches the guest off.
#
# Beside it in its folder: `settings` (what guest.py knows), `command` (a script that becomes the
# command). It leaves `status` (the command's exit status) or `problem` (why there is none).
# tty1 and tty2 are stdout and stderr, tty3 brings names of signals for the command.
folder=${0%/*}
caller_path=$PATH
export PATH=/usr/sbin:/usr/bin:/sbin:/bin

off() {
    sync
    poweroff -f 2>/dev/null
    "$python" -c 'import ctypes; ctypes.CDLL(None).reboot(0x4321fedc)' 2>/dev/null
    echo o >/proc/sysrq-trigger
    sleep 10
}

give_up() {
    echo "$*" >"$folder/problem"
    off
}

. "$folder/settings" # python, limit, through_pipes, one_stream, host, size

mount -t proc proc /proc
mount -t sysfs sysfs /sys
grep -q ' /dev devtmpfs' /proc/mounts || mount -t devtmpfs devtmpfs /dev ||
    give_up "the guest has no devtmpfs"
mkdir -p /dev/pts /dev/shm
mount -t devpts -o mode=620,ptmxmode=666 devpts /dev/pts
mount -t tmpfs -o mode=1777 tmpfs /dev/shm
mkdir -m 1777 /dev/shm/tmp
ln -sf /proc/self/fd /dev/fd
ln -sf /proc/self/fd/0 /dev/stdin
ln -sf /proc/self/fd/1 /dev/stdout
ln -sf /proc/self/fd/2 /dev/stderr
chmod 666 /dev/null /dev/zero /dev/full /dev/random /dev/urandom /dev/tty /dev/tty1 /dev/tty2
echo "$host" >/proc/sys/kernel/hostname

modules=/usr/lib/uml/modules/$(uname -r)/kernel
[[ -d $modules ]] || give_up "no modules of the guest's kernel: $modules"
for module in net/can/can net/can/can-raw net/can/can-bcm drivers/net/can/dev/can-dev \
    drivers/net/can/vcan; do
    for file in "$modules/$module".ko*; do
        [[ ! -e $file ]] || insmod "$file" || give_up "insmod $file failed"
    done
done
trouble=$( { ip link add dev vcan0 type vcan && ip link set vcan0 up; } 2>&1) ||
    give_up "no vcan0 in the guest: $trouble"
ip link set lo up multicast on
ip route add 224.0.0.0/4 dev lo # python-can's udp_multicast

for terminal in /dev/tty1 /dev/tty2; do
    stty -F $terminal raw -echo $size
done
stty -F /dev/tty3 -echo
out=/dev/tty1
err=/dev/tty2
copies=()
if [[ $through_pipes ]]; then # nobody must take the outer pipe or file for a terminal
    mkdir -m 700 /dev/shm/pipes
    for number in 1 2; do
        mkfifo "/dev/shm/pipes/$number"
        cat "/dev/shm/pipes/$number" >"/dev/tty$number" &
        copies+=($!)
    done
    out=/dev/shm/pipes/1
    err=/dev/shm/pipes/2
    exec 8<>$out 9<>$err # so that none of the openings below waits for another
fi
[[ $one_stream ]] && err=$out

set -m # a process group for the command, and SIGINT not ignored in it
if [[ $through_pipes ]]; then
    PATH=$caller_path bash "$folder/command" </dev/null >"$out" 2>"$err" 8>&- 9>&- &
else
    PATH=$caller_path bash "$folder/command" </dev/null >"$out" 2>"$err" &
fi
command=$!
set +m

watch() {
    exec 3</dev/tty3
    while true; do
        read -r -t 2 -u 3 word
        case $? in
        0) kill -s "$word" -- -$command 2>/dev/null ;;
        1) off ;; # the wrapper's end is closed
        esac
        [[ -e $folder/init ]] || off
        [[ -z $limit || $SECONDS -lt $limit ]] || off
    done
}
watch 8>&- 9>&- &

wait $command
status=$?
kill -s KILL -- -$command 2>/dev/null
exec 8>&- 9>&-
for ((i = 0; i < 40; i++)); do # the copies end with the last writer; what is left behind is killed
    kill -0 "${copies[@]}" 2>/dev/null || break
    sleep 0.05
done
stty -F /dev/tty1 sane # waits until the output has gone out
stty -F /dev/tty2 sane
echo $status >"$folder/status"
off
