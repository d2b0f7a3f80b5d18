/* calib_image.S - triax_calib.bin as it lies in flash. A real unit is programmed with it alone. */
    .section .calib, "a"
    .global calib_image, calib_image_end
    .align 2
calib_image:
    .incbin "triax_calib.bin"
calib_image_end:
