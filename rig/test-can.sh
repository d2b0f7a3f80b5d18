#!/usr/bin/env bash
# Real SocketCAN: on this machine's own vcan where it has one, else on Debian's kernel in QEMU,
# whose emulated sja1000 controllers are can0 and can1. Run by `make test-can`, as root.
set -euo pipefail
cd "$(dirname "$0")/.."
python=.venv/bin/python
base=build/test-can
work=$PWD/$base/work
rm -rf "$work"
mkdir -p "$work"
export PYTHONPATH=$PWD/toolchain:$PWD/tests  # of this checkout, wherever .venv was made
$python tests/realcan/prepare.py "$work"

if ip link add dev vcan9 type vcan 2>/dev/null; then
    ip link del vcan9
    echo "test-can: on this machine's own vcan"
    TRIAXCAL_CAN_WORK=$work exec $python -m pytest -q -p no:cacheprovider tests/realcan
fi

missing=()
command -v qemu-system-x86_64 >/dev/null || missing+=(qemu-system-x86)
command -v modprobe >/dev/null || missing+=(kmod)
command -v cpio >/dev/null || missing+=(cpio)
command -v dpkg >/dev/null || missing+=(dpkg)
[ -x /bin/busybox ] || missing+=(busybox-static)
if [ ${#missing[@]} -gt 0 ]; then
    echo "test-can: skipped: acquisition, faults, firmware in the loop and flashing on real SocketCAN."
    echo "test-can: this kernel has no vcan, and QEMU needs: sudo apt-get install ${missing[*]}"
    exit "${TRIAXCAL_SKIP_STATUS:-0}"  # CI asks for a failure
fi

kernel=$base/kernel
if [ ! -e "$kernel/ready" ]; then
    rm -rf "$kernel"
    mkdir -p "$kernel"
    package=$(apt-cache depends linux-image-amd64 | awk '/Depends:/ {print $2; exit}')
    echo "test-can: fetching $package (once) ..."
    (cd "$kernel" && apt-get download -qq "$package" && dpkg -x ./*.deb . && rm ./*.deb)
    touch "$kernel/ready"
fi
version=$(basename "$(echo "$kernel"/lib/modules/*)")
depmod -b "$kernel" "$version"

tree=$base/initrd
rm -rf "$tree"
mkdir -p "$tree"/{bin,modules,host,proc,sys,dev}
cp /bin/busybox "$tree/bin/busybox"
for module in virtio_pci 9pnet_virtio 9p can-raw vcan kvaser_pci; do
    modprobe -d "$kernel" -S "$version" --show-depends "$module" | awk '$1 == "insmod" {print $2}'
done | awk '!seen[$0]++' > "$tree/order"
while read -r file; do cp "$file" "$tree/modules/"; done < "$tree/order"
sed -i 's|.*/||' "$tree/order"

cat > "$tree/init" <<INIT
#!/bin/busybox sh
/bin/busybox --install -s /bin
mount -t proc proc /proc; mount -t sysfs sys /sys; mount -t devtmpfs dev /dev
while read -r m; do
    case \$m in *.xz) xz -dc /modules/\$m > /m.ko; insmod /m.ko;; *) insmod /modules/\$m;; esac
done < /order
o=trans=virtio,version=9p2000.L,msize=262144
mount -t 9p -o \$o,ro,cache=loose host /host || poweroff -f
mount -t 9p -o \$o work /host$work || poweroff -f
mount -t proc proc /host/proc
mount -t sysfs sys /host/sys; mount --bind /dev /host/dev
mkdir -p /host$work/tmp  # 9p has neither shared mappings nor files without a name
mount -t tmpfs tmpfs /host$work/tmp || poweroff -f
ip link set lo up
echo started > /host$work/started
chroot /host /bin/bash -c "cd $PWD && export PATH=$PATH PYTHONDONTWRITEBYTECODE=1 \
    PYTHONPATH=$PYTHONPATH TRIAXCAL_CAN_WORK=$work TMPDIR=$work/tmp TRIAXCAL_CAN_INTERRUPTED=12 && $PWD/$python -m pytest -q -p no:cacheprovider \
    -p no:hypothesispytest --durations=4 tests/realcan; echo \\\$? > $work/status"
sync; poweroff -f
INIT
chmod +x "$tree/init"
(cd "$tree" && find . | cpio -o -H newc --quiet | gzip -1) > "$base/initrd.gz"

echo "test-can: on $version in QEMU"
for attempt in 1 2 3; do
    timeout "${TEST_CAN_TIMEOUT:-1500}" qemu-system-x86_64 -accel tcg -cpu Nehalem -smp 1 -m 1024 \
        -nographic -no-reboot -nic none \
        -kernel "$kernel"/boot/vmlinuz-* -initrd "$base/initrd.gz" \
        -append "console=ttyS0 quiet panic=-1 no_timer_check" \
        -object can-bus,id=c0 -device kvaser_pci,canbus=c0 -device kvaser_pci,canbus=c0 \
        -virtfs local,path=/,mount_tag=host,security_model=none,multidevs=remap,readonly=on \
        -virtfs local,path="$work",mount_tag=work,security_model=none < /dev/null &
    guest=$!
    # The boot alone is tried again, never the tests: a loaded host can let it fail.
    for ((second = 0; second < 240; second++)); do
        if [ -e "$work/started" ] || ! kill -0 "$guest" 2>/dev/null; then break; fi
        sleep 1
    done
    if [ -e "$work/started" ]; then
        wait "$guest" || true
        break
    fi
    kill "$guest" 2>/dev/null || true
    wait "$guest" || true
    echo "test-can: the guest has not booted, attempt $attempt of 3" >&2
done

if [ -e "$work/status" ]; then
    exit "$(cat "$work/status")"
elif [ -e "$work/started" ]; then
    echo "test-can: timed out in the tests" >&2
else
    echo "test-can: the guest never ran the tests" >&2
fi
exit 1
